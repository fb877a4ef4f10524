"""`denseface purge`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal import ask, can_ask, say
from denseface.service.runtime.terminal.progress import Progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--id", metavar="ID", dest="capture_id",
                      help="this capture, finished or not")
    what.add_argument("--before", type=_options.timestamp, metavar="TIME",
                      help="what was accepted before this time, such as 2026-01-31T14:30, UTC or "
                           "with a zone, finished or not")
    what.add_argument("--all", action="store_true",
                      help="all captures, finished or not, and what is in quarantine")
    parser.add_argument("--yes", action="store_true", help="do not ask")


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UnknownCaptureError, UsageError

    chosen = (f"capture {args.capture_id}" if args.capture_id is not None
              else f"all captures accepted before {args.before:%Y-%m-%d %H:%M:%S} UTC"
              if args.before else "all captures")
    if not args.yes:
        if not can_ask():
            raise UsageError("--yes: expected, as there is nobody to ask")
        answer = ask(f"Remove {chosen}, with frame, face and report? [y/N]")
        if (answer or "").lower() not in ("y", "yes"):
            say("nothing removed")
            return 1
    with _options.operator(args) as operator, Progress(f"removing {chosen}"):
        removed = operator.purge(
            capture_id=args.capture_id, before=args.before, everything=args.all)
    if not removed and args.capture_id is not None:
        raise UnknownCaptureError(
            f"capture {args.capture_id}: nothing removed, the hub keeps no such capture")
    say(f"{removed} {'capture' if removed == 1 else 'captures'} removed")
    return 0
