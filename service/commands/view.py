"""`denseface view`."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.commands import _options
from denseface.service.commands._options import reading

if TYPE_CHECKING:
    from denseface.service.view.items import Item

_MAX_PORT = 65535


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("inputs", metavar="FILE|ID", nargs="*",
                        help="a face (.npz), a mesh (.ply .pcd .obj .stl .glb), a frame, a "
                             "recording, a folder of frames or recordings, or a capture's id; "
                             "several are shown in a list, or beside each other")
    parser.add_argument("--last", action="store_true",
                        help="also the capture that the hub accepted last")
    parser.add_argument("--frame", type=_options.whole(0), metavar="N",
                        help="the frame of a recording that is shown first, from 0 (default: 0)")
    reading.add_pair(parser)
    reading.add_calibration(parser)
    _options.add_rotation(parser)
    _options.add_recon(parser)
    parser.add_argument("--no-browser", action="store_true",
                        help="print the page's address and open no browser")
    parser.add_argument("--port", type=_options.whole(0, _MAX_PORT), default=0, metavar="PORT",
                        help="of the page, on this machine alone (default: 0, a free one)")
    parser.add_argument("--once", action="store_true", help="end when the page is closed")
    parser.add_argument("--rerun", action="store_true",
                        help="show it in rerun's viewer in place of the page: images, clouds and "
                             "meshes, each frame of a recording unless --frame takes one; pip "
                             "install 'denseface-core[rerun]' brings it")
    parser.add_argument("--save", type=Path, metavar="OUT.rrd",
                        help="write what --rerun would show")
    _options.add_client(parser)
    parser.add_argument("--timeout", type=_options.seconds, default=60.0, metavar="S",
                        help="longest wait for a capture's face that is being made, seconds "
                             "(default: 60)")


def run(args: argparse.Namespace) -> int:
    from denseface.service.errors import UsageError
    from denseface.service.kiosk.installed import why_not

    _check(args)
    if args.rerun or args.save:
        return _to_rerun(args)
    if reason := why_not("page"):
        raise UsageError(reason)
    items = _items(args)
    from denseface.service.view.serving import PageOptions, serve_page

    return serve_page(items, PageOptions(args.port, not args.no_browser, args.once))


def _to_rerun(args: argparse.Namespace) -> int:
    from denseface.service.export import check_outputs
    from denseface.service.view.rerun_log import to_rerun

    check_outputs((args.save, ".rrd"))
    return to_rerun(_items(args), args.frame, args.save, viewer=args.rerun)


def _check(args: argparse.Namespace) -> None:
    """Check which flags are given together."""
    from denseface.service.errors import UsageError

    if not (args.inputs or args.last or args.depth):
        raise UsageError("expected FILE or ID, --last or --depth")
    if args.color and not args.depth:
        raise UsageError("--color is given without --depth")


def _items(args: argparse.Namespace) -> "list[Item]":
    """Read all that is to be looked at."""
    from denseface.service.view.captures import Captures
    from denseface.service.view.inputs import Reader

    settings = _options.recon_settings(args)
    choice = reading.frame_choice(args, _options.service_settings(args).max_frame_pixels)
    with Captures(partial(_options.operator, args), args.timeout) as captures:
        reader = Reader(choice, settings, args.frame or 0, captures.fetch)
        items = reader.items(args.inputs)
        if args.last:
            items.append(captures.last())
    if args.depth:
        items.append(reader.pair(args.depth, args.color))
    return items
