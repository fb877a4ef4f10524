"""`denseface evaluate`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options

_PRESETS = ("paper", "faithful", "light", "best")
_UNITS, _ALIGNMENTS = ("auto", "mm", "cm", "m"), ("auto", "always", "none")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("inputs", metavar="INPUT", nargs="+",
                        help="a frame, a recording, a folder of them, or a face (.npz), all of "
                             "one head")
    parser.add_argument("--truth", type=Path, required=True, metavar="MESH",
                        help="the true surface: .ply .obj .stl .glb or a face's .npz")
    parser.add_argument("--unit", choices=_UNITS, default="auto",
                        help="of that mesh (default: auto, the one in which it is as large as a "
                             "head)")
    parser.add_argument("--align", choices=_ALIGNMENTS, default="auto",
                        help="lay the truth on the face: auto where it is in another frame, "
                             "always, or none (default: auto)")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="write report.html, evaluation.csv, evaluation.json and error maps "
                             "into this folder")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--frame", type=_options.whole(0), metavar="N",
                       help="which frame of a recording, from 0 (default: 0)")
    which.add_argument("--all-frames", action="store_true", help="each frame of a recording")
    parser.add_argument("--frames", type=_options.burst, default=1, metavar="N",
                        help="average the depth of N frames from there on (default: 1)")
    parser.add_argument("--each-preset", action="store_true",
                        help=f"with each of {', '.join(_PRESETS)}, as the paper's tables have "
                             "several methods")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the file's own")
    _options.add_rotation(parser)
    _options.add_recon(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.recon.settings import Settings
    from denseface.service.errors import UsageError
    from denseface.service.tools.evaluation.command import evaluate
    from denseface.service.tools.evaluation.evaluating import Plan
    from denseface.service.tools.frames import FrameChoice

    if args.each_preset and (args.preset or args.set):
        raise UsageError("--each-preset is given with --preset or --set: it takes all presets as "
                         "they are")
    if args.all_frames and args.frames > 1:
        raise UsageError("--frames is given with --all-frames: each frame becomes a face of its "
                         "own")
    settings = ([Settings.of(preset) for preset in _PRESETS] if args.each_preset
                else [_options.recon_settings(args)])
    choice = FrameChoice(_options.service_settings(args).max_frame_pixels, args.calibration,
                         rotation=args.rotate, burst=args.frames)
    plan = Plan(args.inputs, choice, settings, None if args.all_frames else args.frame or 0,
                args.align)
    return evaluate(plan, args.truth, args.unit, args.output)
