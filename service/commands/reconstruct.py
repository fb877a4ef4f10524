"""`denseface reconstruct`."""

import argparse
import shlex
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.commands._options import reading
from denseface.service.export import FORMATS
from denseface.service.runtime.collection import collect_from_now_on
from denseface.service.runtime.terminal import say, suggest


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
    reading.add_pair(parser)
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
    reading.add_calibration(parser)
    _options.add_export(parser)
    _options.add_rotation(parser)
    _options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError
    from denseface.service.tools.reconstruction.inputs import find_inputs
    from denseface.service.tools.reconstruction.outputs import Outputs

    _check(args)
    settings = _options.recon_settings(args)
    choice = reading.frame_choice(
        args, _options.service_settings(args).max_frame_pixels, args.frames)
    outputs = Outputs(args.output, args.report, args.rendering,
                      f".{args.format}" if args.format else None, args.table,
                      _options.export_options(args), args.textured)
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
    if args.output and Path(args.output).is_file():
        suggest(f"denseface view {shlex.quote(args.output)}", "look at it")
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
