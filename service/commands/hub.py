"""`denseface hub`."""

import argparse

from denseface.service.commands import _options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the flags."""
    _options.add_address(parser)
    _options.add_listen(parser)
    _options.add_data(parser)
    _options.add_retention(parser)
    _options.add_metrics(parser)
    _options.add_recon(parser)
    _options.add_log(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command and give its exit status."""
    from denseface.service.daemons.startup import start_process

    start_process("hub", args.log)
    from denseface.service.daemons import hub

    return hub.run(_options.service_settings(args), _options.recon_settings(args))
