"""`denseface worker`."""

import argparse

from denseface.service.commands import options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_credentials(parser)
    options.add_daemon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.use_one_thread()
    options.start_daemon(args, "worker")
    from denseface.service.daemons import worker

    return worker.run(options.service_settings(args))
