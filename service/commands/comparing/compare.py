"""`denseface compare`."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import _options
from denseface.service.runtime.terminal import complain, say

if TYPE_CHECKING:
    from denseface.recon.face import Face

_CONFIDENCE, _BEYOND_MM, _CAPTURES = 95.0, 1.0, 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = ("a face (.npz), a mesh, a frame, a recording, a folder of them, or a capture's id")
    parser.add_argument("before", metavar="A", help=f"{what}: of the face before")
    parser.add_argument("after", metavar="B", help="the same: of the face after")
    parser.add_argument("-o", "--output", type=Path, action="append", default=[], metavar="OUT",
                        help="write a page .html, .json, a picture .png or a cloud .ply in the "
                             "differences' colours; may be repeated")
    parser.add_argument("--frames", type=_options.burst, metavar="N",
                        help="average the depth of N consecutive frames of a recording to each of "
                             "its captures (default: 8, or all of a shorter one)")
    parser.add_argument("--captures", type=_options.count, default=_CAPTURES, metavar="N",
                        help="take at most N captures of a recording, spread over it "
                             f"(default: {_CAPTURES})")
    parser.add_argument("--confidence", type=_options.percent, default=_CONFIDENCE,
                        metavar="PERCENT",
                        help="that nothing is stated of a face that did not change, 50 to 99.9 "
                             f"(default: {_CONFIDENCE:g})")
    parser.add_argument("--beyond", type=_options.millimetres, default=_BEYOND_MM, metavar="MM",
                        help="say what share differs by more "
                             f"(default: {_BEYOND_MM:g})")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration of frames and recordings that wins over their own")
    parser.add_argument("--timeout", type=_options.seconds, default=60.0, metavar="S",
                        help="longest wait for a capture's face, seconds (default: 60)")
    _options.add_rotation(parser)
    _options.add_recon(parser)
    _options.add_client(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.tools.comparison.command import Request, compare
    from denseface.service.tools.comparison.sides import Reading
    from denseface.service.tools.frames import FrameChoice

    choice = FrameChoice(_options.service_settings(args).max_frame_pixels, args.calibration,
                         rotation=args.rotate)
    reading = Reading(choice, _options.recon_settings(args), args.frames, args.captures,
                      partial(_fetch, args))
    lines, doubts = compare(Request(args.before, args.after, tuple(args.output),
                                    args.confidence / 100, args.beyond), reading)
    say(*lines)
    for line in doubts:
        complain(f"warning: {line}")
    return 0


def _fetch(args: argparse.Namespace, capture_id: str) -> "Face":
    with _options.operator(args) as client:
        return client.get(capture_id, timeout=args.timeout)
