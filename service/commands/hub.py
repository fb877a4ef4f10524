"""`denseface hub`."""

import argparse

from denseface.service.commands import _options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_hub(parser)


def run(args: argparse.Namespace) -> int:
    from denseface.service.daemons.startup import start_process

    supervisor = start_process("hub", args.log)
    from denseface.service.daemons import hub

    return hub.run(_options.service_settings(args), _options.recon_settings(args), supervisor)
