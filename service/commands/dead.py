"""`denseface dead`."""

import argparse

from denseface.service.commands import options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    parser.add_argument("action", choices=("list", "retry", "drop"),
                        help="list: sequence number, id, time, attempts, reason; retry: all "
                             "attempts again; drop: remove frame, error and row")
    parser.add_argument("ids", nargs="*", metavar="ID", help="captures to retry or drop")
    parser.add_argument("--all", action="store_true", help="retry or drop all of them")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from pydantic import ValidationError

    from denseface.service.errors import LocalProtocolError, UsageError

    if args.action == "list" and (args.ids or args.all):
        raise UsageError("dead list: takes neither ids nor --all")
    if args.action != "list" and bool(args.ids) == args.all:
        raise UsageError(f"dead {args.action}: expected ids, or --all")
    with options.operator(args) as operator:
        if args.action == "list":
            for one in operator.dead():
                reason = " ".join(one.message.split())
                print(f"{one.sequence} {one.capture_id} {one.finished_at} {one.attempts} attempts: "
                      f"{reason} ({one.error})")
            return 0
        act = operator.retry if args.action == "retry" else operator.drop
        ids = args.ids or [one.capture_id for one in operator.dead()]
        for capture_id in ids:
            try:
                act(capture_id)
            except ValidationError as error:
                raise LocalProtocolError(f"capture id {capture_id!r}: malformed") from error
            print(capture_id, flush=True)
    return 0
