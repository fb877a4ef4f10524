"""`denseface reconstruct`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import _options
from denseface.service.runtime.terminal import complain, say

if TYPE_CHECKING:
    from denseface.capture import RgbdFrame


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="INPUT", nargs="?",
                        help="a .npz frame, a .oni recording, or a folder of frames or image pairs")
    parser.add_argument("--frame", type=int, default=0, metavar="N",
                        help="which frame of the recording, from 0 (default: 0)")
    parser.add_argument("--frames", type=_options.burst, default=1, metavar="N",
                        help="average the depth of N frames from there on (default: 1)")
    parser.add_argument("--depth", type=Path, metavar="D.png",
                        help="instead of INPUT: a depth image, .png .tiff .exr or .npy")
    parser.add_argument("--color", type=Path, metavar="C.png",
                        help="its colour image, .png .jpg .webp or .npy")
    parser.add_argument("--unit", metavar="UNIT",
                        help="what 1 stands for in a depth image: mm, 100um, 0.2mm (TUM RGB-D) or "
                             "m (default: guessed where only one makes sense)")
    parser.add_argument("--registered", choices=("yes", "no", "auto"), default="auto",
                        help="whether a depth image is in the colour image's pixels "
                             "(default: auto)")
    parser.add_argument("--rounding", choices=("cut", "round", "none"),
                        help="how a depth image's depth became a whole number: cut, as "
                             "PrimeSense's drivers do (default: round)")
    _options.add_outputs(parser, "-o", "--output")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the file's own: JSON, or OpenCV's or "
                             "ROS's YAML")
    _options.add_rotation(parser)
    _options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.export import FaceFiles

    files = FaceFiles(args.output, args.report, args.rendering)
    settings = _options.recon_settings(args)
    frame = _frame(args)

    from denseface.recon import ReconstructionError, reconstruct

    try:
        face = reconstruct(frame, settings)
    except ReconstructionError:
        for note in frame.origin.notes:
            complain(f"warning: {note}")
        raise
    files.write(face)
    _options.warn(face)
    report = face.report
    say(f"{report.initial_points} measured points, {report.dense_points} dense points, "
        f"{report.timings_ms['total']:.0f} ms")
    return 0


def _frame(args: argparse.Namespace) -> "RgbdFrame":
    from denseface.capture import DepthRounding
    from denseface.capture.image_pair import PairReading, parse_unit
    from denseface.service.errors import UsageError
    from denseface.service.tools.frames import read_frame, read_image_pair

    if (args.input is None) == (args.depth is None):
        raise UsageError("expected INPUT or --depth, found "
                         f"{'neither' if args.input is None else 'both'}")
    if args.color and not args.depth:
        raise UsageError("--color is given without --depth")
    most = _options.service_settings(args).max_frame_pixels
    try:
        unit_mm = parse_unit(args.unit) if args.unit else None
    except ValueError as error:
        raise UsageError(f"--unit {error}") from error
    registered = None if args.registered == "auto" else args.registered == "yes"
    rounding = DepthRounding(args.rounding or DepthRounding.ROUND)
    reading = PairReading(unit_mm, registered, rounding=rounding, max_pixels=most)
    if args.depth:
        if args.frame or args.frames > 1:
            raise UsageError("--frame or --frames is given with --depth: a pair of images is one "
                             "frame")
        return read_image_pair(args.depth, args.color, args.calibration, reading, args.rotate)
    said = unit_mm is not None or registered is not None or args.rounding is not None
    return read_frame(args.input, args.frame, args.calibration, most, args.frames,
                      reading if said else None, args.rotate)
