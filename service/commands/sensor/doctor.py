"""`denseface doctor`."""

import argparse

from denseface.service.commands import _options
from denseface.service.runtime.terminal.progress import Progress

_LONG_S = 30.0
"""Elsewhere than on a terminal, its lines come soon enough until then, seconds."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    parser.add_argument("--source", metavar="URI",
                        help="look at this sensor alone, openni2:NAME with its serial number, USB "
                             "port or address (default: at all)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    from denseface.service.commands.sensor._kiosk_findings import look_at_kiosk
    from denseface.service.tools import doctor

    with Progress("looking at drivers, sensors and the hub", plain_after_s=_LONG_S):
        return doctor.run(args.source, lambda: _options.client(args, quiet=True),
                          as_json_object=args.json, more=look_at_kiosk())
