"""`denseface worker`."""

import argparse

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_client(parser)
    _options.add_log(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process, use_one_thread

    use_one_thread()
    supervisor = start_process("worker", args.log)
    from denseface.service.daemons import worker

    return worker.run(_options.service_settings(args), supervisor)
