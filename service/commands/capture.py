"""`denseface capture`."""

import argparse
from pathlib import Path

from denseface.service.commands import options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    add_source(parser)
    options.add_daemon(parser)


def add_source(parser: argparse.ArgumentParser) -> None:
    """Say where frames come from."""
    parser.add_argument("--source", default="openni2:", metavar="URI",
                        help="openni2: for the first sensor, or a .oni or .npz file "
                             "(default: openni2:)")
    parser.add_argument("--calibration", type=Path, metavar="FILE.json",
                        help="calibration that wins over the source's own")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.start_daemon(args, "capture")
    from denseface.service.daemons import capture

    return capture.run(options.service_settings(args), args.source, args.calibration)
