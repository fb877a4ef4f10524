"""What a shell runs to complete commands, flags, their values and names of files."""

import argparse
import re
from typing import Any

from denseface.missing import explained

__all__ = ["script"]

_FILES = re.compile(r"\b(INPUT|FILE|FOLDER|DIR|OUT|KEY|PATH|\w*\.\w{3,4})\b")
"""Words for a value that is a file's name."""


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Give the script that a shell reads at its start.

    Parameters
    ----------
    parser : with all commands and their flags
    shell : one that shtab knows

    Raises
    ------
    MissingPackageError
        shtab is not installed.
    """
    with explained():
        import shtab

    _name_files(parser, shtab.FILE)
    made: str = shtab.complete(parser, shell)
    return made.rstrip("\n")


def _name_files(parser: argparse.ArgumentParser, file: dict[str, Any]) -> None:
    """Say of each flag and word that takes a file's name that it does."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                _name_files(one, file)
        elif not action.choices and _FILES.search(str(action.metavar or "")):
            action.complete = file  # type: ignore[attr-defined]
