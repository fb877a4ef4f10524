"""`denseface reconstruct`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import options
from denseface.service.commands.press import add_outputs

if TYPE_CHECKING:
    from denseface.capture import RgbdFrame

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    parser.add_argument("input", metavar="INPUT", help="a .npz frame or a .oni recording")
    parser.add_argument("--frame", type=int, default=0, metavar="N",
                        help="which frame of the recording, from 0 (default: 0)")
    add_outputs(parser, "-o", "--output")
    parser.add_argument("--calibration", type=Path, metavar="FILE.json",
                        help="calibration that wins over the file's own")
    options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from denseface.service.export.files import FaceFiles

    files = FaceFiles(args.save, args.report, args.preview)
    settings = options.recon_settings(args)
    frame = _frame(args.input, args.frame, args.calibration)

    from denseface.recon import reconstruct

    face = reconstruct(frame, settings)
    files.write(face)
    report = face.report
    print(f"{report.initial_points} measured points, {report.dense_points} dense points, "
          f"{report.timings_ms['total']:.0f} ms")
    return 0


def _frame(uri: str, number: int, calibration: Path | None) -> "RgbdFrame":
    from denseface.capture import open_source
    from denseface.service.errors import UsageError

    if uri.startswith("openni2:"):
        raise UsageError(f"{uri}: expected a .npz or .oni file; `denseface up` serves a sensor")
    with open_source(uri, calibration=calibration) as source:
        count = source.frame_count
        if count is not None and not 0 <= number < count:
            raise UsageError(f"{uri}: has {count} frames (0 to {count - 1}), --frame asks for "
                             f"{number}")
        for index, frame in enumerate(source):
            if index == number:
                return frame
    raise UsageError(f"{uri}: has fewer than {number + 1} pairs of depth and colour")
