"""The command line: commands' flags are read, one is run, an error is one line and a status."""

from denseface.service.cli._main import main

__all__ = ["main"]
