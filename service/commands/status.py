"""`denseface status`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--wait", type=_options.seconds, metavar="SECONDS",
                        help="wait until hub, a sensor and a worker are ready; fail where they "
                             "are not in this time")


def run(args: argparse.Namespace) -> int:
    from denseface.service.tools.status import as_json, as_text, ready_status

    with _options.client(args) as client:
        status = ready_status(client, args.wait) if args.wait else client.status()
        say(*(as_json if args.json else as_text)(client.address, status).split("\n"))
    return 0
