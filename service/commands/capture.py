"""`denseface capture`."""

import argparse

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    _options.add_source(parser)
    parser.add_argument("--name", type=_options.sensor_name, metavar="NAME",
                        help="name of the sensor, for `press --sensor` (default: made of what is "
                             "known of it: its serial number, USB port or address)")
    _options.add_log(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process

    supervisor = start_process("capture", args.log)
    from denseface.service.daemons import capture

    return capture.run(_options.service_settings(args), args.source, args.calibration, supervisor,
                       args.name, rotation=args.rotate)
