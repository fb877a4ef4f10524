"""`denseface press`."""

import argparse
import math
from pathlib import Path

from denseface.service.commands import options

__all__ = ["add_arguments", "run", "seconds"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    parser.add_argument("--id", metavar="ID", dest="capture_id",
                        help="id of the capture; the same one again is the same capture")
    parser.add_argument("--timeout", type=seconds, default=60.0, metavar="S",
                        help="longest wait for the face, seconds (default: 60)")
    add_outputs(parser, "--save")


def add_outputs(parser: argparse.ArgumentParser, *save: str) -> None:
    """Say what is to be written of a face."""
    parser.add_argument(*save, type=Path, metavar="OUT", dest="save",
                        help="write the face: .ply .pcd .npz .obj .glb or .stl")
    parser.add_argument("--report", type=Path, metavar="R.json", help="write the report")
    parser.add_argument("--preview", type=Path, metavar="P.png", help="write a picture")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from denseface.service.export.files import FaceFiles

    files = FaceFiles(args.save, args.report, args.preview)
    with options.client(args) as client:
        capture_id = client.press(args.capture_id, timeout=args.timeout)
        print(capture_id, flush=True)
        face = client.get(capture_id, timeout=args.timeout)
    files.write(face)
    return 0


def seconds(text: str) -> float:
    """Read a time-out."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= 86400:
        raise argparse.ArgumentTypeError(f"{text!r}: expected seconds, more than 0")
    return value
