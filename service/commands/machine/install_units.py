"""`denseface install-units`."""

import argparse
import os
from pathlib import Path

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--dry-run", action="store_true",
                      help="print the units and what is to be typed then; write nothing")
    what.add_argument("--uninstall", action="store_true",
                      help="stop what the units started and remove them; frames, faces and "
                           "settings stay")
    parser.add_argument("--user", action="store_true",
                        help="for this user's own systemd, with what of the sandbox works there")
    parser.add_argument("--workers", type=_options.whole(1, 256), metavar="N",
                        default=max(1, (os.cpu_count() or 2) - 1),
                        help="reconstruction processes (default: cores less one)")
    parser.add_argument("--sensor", action="append", metavar="NAME", default=[],
                        help="of several sensors, the name of each; its source is set in "
                             "capture-NAME.env (default: one process with the first sensor)")
    parser.add_argument("--no-kiosk", action="store_true",
                        help="do not start the page for visitors with the others")
    parser.add_argument("--folder", type=Path, metavar="DIR",
                        help="write them there, and tell systemd nothing (default: "
                             "/etc/systemd/system, ~/.config/systemd/user with --user)")
    parser.add_argument("--force", action="store_true",
                        help="overwrite or remove also what was changed by hand")


def run(args: argparse.Namespace) -> int:
    from denseface.service.tools.units import Choice, install, show, uninstall

    choice = Choice(args.workers, tuple(args.sensor), not args.no_kiosk, args.user)
    if args.dry_run:
        return show(choice, args.folder)
    return (uninstall if args.uninstall else install)(choice, args.folder, force=args.force)
