"""`denseface bench`."""

import argparse
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say

_ROUNDS, _QUICK_ROUNDS = 100, 15


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="INPUT", nargs="?",
                        help="a frame, a recording or a folder, of which the first frame is taken "
                             "(default: a simulated frame that comes along)")
    parser.add_argument("--quick", action="store_true",
                        help=f"{_QUICK_ROUNDS} rounds in place of {_ROUNDS}")
    parser.add_argument("--calibration", type=Path, metavar="FILE",
                        help="calibration that wins over the file's own")
    _options.add_recon(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import use_one_thread

    use_one_thread()
    settings = _options.recon_settings(args)
    from denseface.service.tools.bench import as_json, as_lines, measure_speed

    found = measure_speed(args.input, args.calibration, settings,
                          _QUICK_ROUNDS if args.quick else _ROUNDS)
    say(*([as_json(found)] if args.json else as_lines(found)))
    return 0
