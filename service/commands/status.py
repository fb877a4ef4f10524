"""`denseface status`."""

import argparse

from denseface.service.commands import _options
from denseface.service.errors import UsageError
from denseface.service.runtime.terminal import complain, say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--wait", type=_options.seconds, metavar="SECONDS",
                        help="wait until hub, a sensor and a worker are ready; fail where they "
                             "are not in this time")
    parser.add_argument("--healthy", type=_options.part, nargs="?", const="service",
                        metavar="PART",
                        help="print nothing, and fail where this is not well now: service (a "
                             "press would become a face), hub, sensor, sensor:NAME, worker (of "
                             "this machine) or kiosk (of DENSEFACE_KIOSK_...; default: service)")


def run(args: argparse.Namespace) -> int:
    from denseface.service.tools.status import as_json, as_text, ready_status

    if args.healthy:
        return _tell_health(args)
    with _options.client(args) as client:
        status = ready_status(client, args.wait) if args.wait else client.status()
        say(*(as_json if args.json else as_text)(client.address, status).split("\n"))
    return 0


def _tell_health(args: argparse.Namespace) -> int:
    if args.json or args.wait:
        raise UsageError("--healthy: expected neither --json nor --wait with it")
    if args.healthy == "kiosk":
        from denseface.service.commands._options.kiosk import kiosk_settings
        from denseface.service.kiosk.answering import ask

        ailment = ask(kiosk_settings(args)).ailment
    else:
        from denseface.service.tools.healthy import what_ails

        with _options.client(args, quiet=True) as client:
            ailment = what_ails(client, args.healthy)
    if ailment:
        complain(f"denseface status: not healthy: {ailment}")
    return int(bool(ailment))
