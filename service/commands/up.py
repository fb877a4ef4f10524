"""`denseface up`."""

import argparse
import os

from service.commands import capture, options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    capture.add_source(parser)
    parser.add_argument("--workers", type=_count, default=max(1, (os.cpu_count() or 2) - 1),
                        metavar="N", help="reconstruction processes (default: cores less one)")
    options.add_address(parser)
    options.add_hub(parser)
    options.add_retention(parser)
    options.add_recon(parser)
    options.add_daemon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.start_daemon(args, "up")
    from service.addresses import check_bindable
    from service.supervisor import Supervisor, processes

    settings = options.service_settings(args)
    check_bindable(settings.address)
    changed = options.recon_arguments(args)
    options.recon_settings(args)
    common = ["--address", settings.address, "--log", args.log]
    if args.debug:
        common.append("--debug")
    chosen = ["--calibration", str(args.calibration)] if args.calibration else []
    hub = ["--data", str(settings.data), *changed]
    if args.retention:
        hub += ["--retention", args.retention]
    table = processes(args.source, args.workers, common, hub, chosen)
    return Supervisor(table).run()


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number from 1 to 256")
    return int(text)
