"""`denseface completion`."""

import argparse

from denseface.service.runtime.terminal import say

SHELLS = "bash", "zsh", "fish"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))


def run(args: argparse.Namespace) -> int:
    from denseface.service.tools.completion import script

    say(*script(args.whole_parser(), args.shell).split("\n"))
    return 0
