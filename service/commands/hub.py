"""`denseface hub`."""

import argparse

from denseface.service.commands import options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_listen(parser)
    options.add_hub(parser)
    options.add_retention(parser)
    options.add_metrics(parser)
    options.add_recon(parser)
    options.add_daemon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.start_daemon(args, "hub")
    from denseface.service.daemons import hub

    return hub.run(options.service_settings(args), options.recon_settings(args))
