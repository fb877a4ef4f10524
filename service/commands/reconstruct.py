"""`denseface reconstruct`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import _options
from denseface.service.export import FORMATS
from denseface.service.runtime.collection import collect_from_now_on
from denseface.service.runtime.terminal import say

if TYPE_CHECKING:
    from denseface.service.tools.frames import FrameChoice


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("inputs", metavar="INPUT", nargs="*",
                        help="a .npz frame, a .oni recording, or a folder of frames, of recordings "
                             "or of image pairs; several make a face of each and a table")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--frame", type=_options.whole(0), metavar="N",
                       help="which frame of a recording, from 0 (default: 0)")
    which.add_argument("--all-frames", action="store_true",
                       help="a face of each frame, NAME_0000 and so on")
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
    *endings, last = FORMATS
    parser.add_argument("-o", "--output", metavar="OUT|DIR/",
                        help=f"write the face: {' '.join(endings)} or {last}; into a folder as "
                             "NAME.ply, after its INPUT; what is there is replaced")
    parser.add_argument("--format", choices=[ending[1:] for ending in FORMATS],
                        help="of the faces in a folder (default: ply)")
    parser.add_argument("--report", metavar="R.json|DIR/", help="write the report")
    parser.add_argument("--preview", metavar="P.png|DIR/", dest="rendering",
                        help="write a picture of the face; where there is none, of the frame and "
                             "what looked like one")
    parser.add_argument("--table", type=Path, metavar="T.csv",
                        help="write the table of the faces, of one INPUT too")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the file's own: JSON, or OpenCV's or "
                             "ROS's YAML")
    _options.add_rotation(parser)
    _options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError
    from denseface.service.tools.reconstruction.inputs import find_inputs
    from denseface.service.tools.reconstruction.outputs import Outputs

    _check(args)
    settings, choice = _options.recon_settings(args), _choice(args)
    outputs = Outputs(args.output, args.report, args.rendering,
                      f".{args.format}" if args.format else None, args.table)
    inputs = find_inputs(args.inputs)
    if args.inputs and not inputs:
        raise UsageError("INPUT: calibrations alone, expected a frame, recording or folder")
    several = args.all_frames or len(inputs) > 1 or bool(args.table and inputs)
    images = [path for path in (args.depth, args.color, args.calibration) if path]
    outputs.check([one.name for one in inputs] or [args.depth.stem],
                  [*(one.path for one in inputs), *images], several=several)
    if several:
        from denseface.service.tools.reconstruction.many import reconstruct_many

        collect_from_now_on()
        return reconstruct_many(inputs, choice, settings, outputs,
                                None if args.all_frames else args.frame or 0)
    from denseface.service.tools.reconstruction import single

    if args.depth:
        taken = single.take_pair(args.depth, args.color, choice)
    else:
        taken = single.take(inputs[0], args.frame or 0, choice)
    face, lines = single.reconstruct_one(taken, settings, outputs)
    _options.warn(face)
    say(*lines)
    total = taken.read.total or 1
    if args.frame is None and args.frames == 1 and total > 1:
        say(f"frame 0 of {total}: --frame N takes another, --all-frames each")
    return 0


def _check(args: argparse.Namespace) -> None:
    """Check which flags are given together."""
    from denseface.service.errors import UsageError

    if bool(args.inputs) == bool(args.depth):
        raise UsageError("expected INPUT or --depth, found "
                         f"{'both' if args.inputs else 'neither'}")
    if args.color and not args.depth:
        raise UsageError("--color is given without --depth")
    if args.depth and (args.frame or args.all_frames or args.frames > 1):
        raise UsageError("--frame, --all-frames or --frames is given with --depth: a pair of "
                         "images is one frame")
    if args.depth and args.table:
        raise UsageError("--table is given with --depth: a pair of images is one frame")
    if args.all_frames and args.frames > 1:
        raise UsageError("--frames is given with --all-frames: each frame becomes a face of its "
                         "own")


def _choice(args: argparse.Namespace) -> "FrameChoice":
    """Read how frames are to be read."""
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
    return FrameChoice(_options.service_settings(args).max_frame_pixels, args.calibration,
                       reading if said else None, args.rotate, args.frames)
