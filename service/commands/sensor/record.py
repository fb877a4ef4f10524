"""`denseface record`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("output", type=Path, metavar="OUT",
                        help="NAME.oni, or a folder for one .npz frame file each")
    _options.add_source(parser, rotated=False)
    parser.add_argument("--seconds", type=_options.seconds, metavar="S",
                        help="end after S seconds (default: at Ctrl-C, or the source's end)")
    parser.add_argument("--frames", type=_options.count, metavar="N", help="end after N frames")
    _options.add_mode(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import use_one_thread

    use_one_thread()
    from denseface.service.tools import record

    return record.run(args.source, args.calibration, args.output, frames=args.frames,
                      seconds=args.seconds, mode=args.mode)
