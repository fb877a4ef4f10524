"""`denseface up`."""

import argparse
import os

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_source(parser)
    parser.add_argument("--workers", type=_worker_count, default=max(1, (os.cpu_count() or 2) - 1),
                        metavar="N", help="reconstruction processes (default: cores less one)")
    _options.add_hub(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process

    start_process("up", args.log)
    from denseface.service.daemons.service_manager import ServiceManager
    from denseface.service.daemons.supervisor import Supervisor, check_settings, process_table

    settings = _options.service_settings(args)
    check_settings(settings)
    _options.recon_settings(args)
    table = process_table(
        args.workers,
        common=_options.repeated(args, "address", "log", "debug"),
        hub=_options.repeated(args, "data", "keys", "key", "listen", "retention", "metrics",
                              "preset", "set"),
        capture=_options.repeated(args, "source", "calibration"))
    with ServiceManager(os.environ) as manager:
        return Supervisor(table, max(settings.hang_timeout_s, settings.silence_s), manager).run()


def _worker_count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number from 1 to 256")
    return int(text)
