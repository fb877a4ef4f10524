"""`denseface warm`."""

import argparse

from denseface.service.runtime.terminal import complain, say, suggest


def add_arguments(parser: argparse.ArgumentParser) -> None:  # it has none
    pass


def run(args: argparse.Namespace) -> int:  # noqa: ARG001
    from denseface.service.daemons.startup import use_one_thread

    use_one_thread()
    from denseface.service.tools.warm import warm_up

    kept = warm_up()
    if kept.lost:
        complain(f"denseface warm: {kept.lost}")
        return 1
    say(kept.found)
    suggest("denseface doctor", "is everything here that a sensor needs?")
    return 0
