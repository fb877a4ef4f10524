"""`denseface dead`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("action", choices=("list", "retry", "drop"),
                        metavar="list|retry|drop",
                        help="list: sequence number, id, time, attempts, reason; retry: all "
                             "attempts again; drop: remove frame, error and row")
    parser.add_argument("ids", nargs="*", default=[], metavar="ID",
                        help="captures to retry or drop")
    parser.add_argument("--all", action="store_true", help="retry or drop all of them")


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError

    if args.action == "list" and (args.ids or args.all):
        raise UsageError("list: expected neither ids nor --all")
    if args.action != "list" and bool(args.ids) == args.all:
        raise UsageError(f"{args.action}: expected ids, or --all")
    with _options.operator(args) as operator:
        if args.action == "list":
            for letter in operator.dead():
                reason = " ".join(letter.message.split())
                say(f"{letter.sequence} {letter.capture_id} {letter.finished_at} "
                    f"{letter.attempts} attempts: {reason} ({letter.error})")
            return 0
        act = operator.retry if args.action == "retry" else operator.drop
        ids = args.ids or [letter.capture_id for letter in operator.dead()]
        for capture_id in ids:
            act(capture_id)
            say(capture_id, flush=True)
    return 0
