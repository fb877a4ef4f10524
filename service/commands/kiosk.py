"""`denseface kiosk`."""

import argparse

from denseface.service.commands import _options
from denseface.service.commands._options.kiosk import add_kiosk, kiosk_settings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    add_kiosk(parser)
    parser.add_argument(
        "--new-operator-token", action="store_true",
        help="make a token for the operator's page, show it and end; the one before and its "
             "sessions are good no more")
    _options.add_log(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process, use_one_thread

    if args.new_operator_token:
        return _show_new_token(args)
    use_one_thread()
    supervisor = start_process("kiosk", args.log)
    settings = kiosk_settings(args)
    from denseface.service.errors import UsageError
    from denseface.service.kiosk.installed import why_not

    if reason := why_not():
        raise UsageError(reason)
    from denseface.service.kiosk import process

    return process.run(_options.service_settings(args), settings, supervisor)


def _show_new_token(args: argparse.Namespace) -> int:
    from denseface.service.kiosk.operator.token import OperatorToken
    from denseface.service.runtime.terminal import say

    say(OperatorToken(kiosk_settings(args).folder).renew(), flush=True)
    return 0
