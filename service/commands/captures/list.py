"""`denseface list`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--last", type=_options.whole(1, 50), default=20, metavar="N",
                        help="so many, the newest first, at most 50 (default: 20)")


def run(args: argparse.Namespace) -> int:
    with _options.operator(args) as operator:
        for one in operator.captures(args.last):
            why = f": {' '.join((one.message or '').split())} ({one.error})" if one.error else ""
            say(f"{one.capture_id} {one.accepted_at} {one.state}{why}")
    return 0
