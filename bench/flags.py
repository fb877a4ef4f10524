"""What both benchmarks against peers can be asked."""

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path

from bench.pcl_peer import Pcl, PclMissingError

__all__ = ["add_flags", "check_flags", "open_pcl"]


def add_flags(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    parser.add_argument("--pcl", action="store_true",
                        help="install Debian's libpcl-dev where it is missing (large)")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw into this folder")


def check_flags(parser: argparse.ArgumentParser, args: argparse.Namespace) -> None:
    """Refuse before the work what cannot be done after it."""
    if args.pictures and find_spec("matplotlib") is None:
        parser.error("--pictures needs matplotlib, which is not installed")


def open_pcl(args: argparse.Namespace) -> Pcl | None:
    """Give the peer, or say why it is left out."""
    try:
        return Pcl(install=args.pcl)
    except PclMissingError as missing:
        print(f"PCL is left out: {missing}", file=sys.stderr)
        return None
