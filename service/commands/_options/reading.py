"""Flags of how frames are read from files, and what is made of them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from denseface.service.tools.frames import FrameChoice

__all__ = ["add_calibration", "add_pair", "add_reading", "frame_choice"]


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Add `--depth`, `--color` and how image files are to be understood."""
    parser.add_argument("--depth", type=Path, metavar="D.png",
                        help="instead of INPUT: a depth image, .png .tiff .exr or .npy")
    parser.add_argument("--color", type=Path, metavar="C.png",
                        help="its colour image, .png .jpg .webp or .npy")
    add_reading(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add how image files are to be understood."""
    parser.add_argument("--unit", metavar="UNIT",
                        help="what 1 stands for in a depth image: mm, 100um, 0.2mm (TUM RGB-D) or "
                             "m (default: guessed where only one makes sense)")
    parser.add_argument("--registered", choices=("yes", "no", "auto"), default="auto",
                        help="whether a depth image is in the colour image's pixels "
                             "(default: auto)")
    parser.add_argument("--rounding", choices=("cut", "round", "none"),
                        help="how a depth image's depth became a whole number: cut, as "
                             "PrimeSense's drivers do (default: round)")


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """Add `--calibration`, of frames in files."""
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the file's own: JSON, or OpenCV's or "
                             "ROS's YAML")


def frame_choice(
    args: argparse.Namespace, max_pixels: int, burst: int = 1
) -> "FrameChoice":
    """Read how frames are to be read; raises `UsageError` where `--unit` is none."""
    from denseface.capture import DepthRounding
    from denseface.capture.image_pair import PairReading, parse_unit
    from denseface.service.errors import UsageError
    from denseface.service.tools.frames import FrameChoice

    try:
        unit_mm = parse_unit(args.unit) if args.unit else None
    except ValueError as error:
        raise UsageError(f"--unit {error}") from error
    registered = None if args.registered == "auto" else args.registered == "yes"
    said = unit_mm is not None or registered is not None or args.rounding is not None
    reading = PairReading(unit_mm, registered,
                          rounding=DepthRounding(args.rounding or DepthRounding.ROUND))
    return FrameChoice(max_pixels, args.calibration, reading if said else None, args.rotate, burst)
