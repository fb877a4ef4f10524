"""`denseface subscribe`."""

import argparse
from itertools import islice
from pathlib import Path

from denseface.service.commands import _options
from denseface.service.export import FORMATS
from denseface.service.runtime.terminal import complain, say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--save", type=Path, metavar="DIR",
                        help="write each face as DIR/ID.ply with its report, DIR/ID.json; the "
                             "folder is made")
    parser.add_argument("--format", action="append", choices=[one[1:] for one in FORMATS],
                        help="of the files that --save writes; may be repeated (default: ply)")
    _options.add_mode(parser)
    parser.add_argument("--count", type=_options.count, metavar="N", help="end after N captures")
    parser.add_argument("--sensor", type=_options.sensor_name, metavar="NAME",
                        help="with --hints: of this sensor alone")
    start = parser.add_mutually_exclusive_group()
    start.add_argument("--hints", action="store_true",
                       help="follow what could be better in front of the sensor, a line for each "
                            "change, in place of the faces")
    start.add_argument("--after", type=_options.whole(0), metavar="SEQUENCE",
                       help="start after this sequence number; 0 is all that is kept "
                            "(default: only what comes from now on)")
    start.add_argument("--last", type=_options.count, metavar="N",
                       help="start with the last N captures that are kept")
    start.add_argument("--since", type=_options.timestamp, metavar="TIME",
                       help="start with what ended at this time or later, such as "
                            "2026-01-31T14:30, UTC or with a zone")


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError
    from denseface.service.tools.follow import FaceFolder, changes, follow

    if args.format and not args.save:
        raise UsageError("--format: expected with --save DIR, which writes the files")
    if args.hints and args.save:
        raise UsageError("--save: expected without --hints, which gives no faces")
    if args.sensor and not args.hints:
        raise UsageError("--sensor: expected with --hints; faces are of all sensors")
    endings = [f".{one}" for one in dict.fromkeys(args.format or ["ply"])]
    folder = FaceFolder(args.save, endings, args.mode) if args.save else None
    lost = 0
    with _options.client(args) as client:
        if args.hints:
            for line in islice(changes(client.hints(sensor=args.sensor)), args.count):
                say(line, flush=True)
            return 0
        published = client.published(after=args.after, last=args.last, since=args.since)
        for told in islice(follow(published, folder), args.count):
            if told.lost:
                lost += 1
                complain(f"denseface subscribe: {told.line}")
            else:
                say(told.line, flush=True)
    return 1 if lost else 0
