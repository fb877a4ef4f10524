"""`denseface worker`."""

import argparse
import os

from service.commands import options

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    options.add_address(parser)
    options.add_daemon(parser)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from service.supervisor import ONE_THREAD

    for name, value in ONE_THREAD.items():  # read once, when NumPy is first imported
        os.environ.setdefault(name, value)
    options.start_daemon(args, "worker")
    from service import workerd

    return workerd.run(options.service_settings(args))
