"""One line on stderr that is written over, where that is a terminal."""

import shutil
import sys
import time
from collections.abc import Callable
from typing import Self

from denseface.service.runtime.terminal import printable

_REFRESH_S = 0.1
"""Shortest time between two writings, seconds."""


class StatusLine:
    """The line; cleared at the end of the `with` block."""

    def __init__(self) -> None:
        self._shown = sys.stderr is not None and sys.stderr.isatty()
        self._due = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            self._write("")

    def show(self, text: Callable[[], str]) -> None:
        """Show what `text` gives, unless the line was written just now."""
        if not self._shown or (now := time.monotonic()) < self._due:
            return
        self._due = now + _REFRESH_S
        self._write(text())

    def _write(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{printable(text)[:width]}\x1b[K", end="", file=sys.stderr, flush=True)
