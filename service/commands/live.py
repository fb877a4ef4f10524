"""`denseface live`."""

import argparse

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_source(parser)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--seconds", type=_options.seconds, metavar="S",
                        help="end after S seconds (default: at Ctrl-C)")
    length.add_argument("--frames", type=_options.count, metavar="N", help="end after N frames")
    _options.add_recon(parser)
    parser.add_argument("--json", action="store_true", help="print the summary as one JSON object")


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import use_one_thread

    use_one_thread()
    settings = _options.recon_settings(args)
    from denseface.service.tools import live

    return live.run(args.source, args.calibration, settings, rotation=args.rotate,
                    frames=args.frames, seconds=args.seconds, as_json=args.json)
