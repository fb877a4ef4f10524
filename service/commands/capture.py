"""`denseface capture`."""

import argparse

from denseface.service.commands import _options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the flags."""
    _options.add_address(parser)
    _options.add_credentials(parser)
    _options.add_source(parser)
    _options.add_log(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command and give its exit status."""
    from denseface.service.daemons.startup import start_process

    start_process("capture", args.log)
    from denseface.service.daemons import capture

    return capture.run(_options.service_settings(args), args.source, args.calibration)
