"""How far an archive is, on stderr: a bar that moves on a terminal, a line now and then elsewhere.

What else is said meanwhile goes above the bar; nothing is ever written to stdout.
"""

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Self

from denseface.service.runtime.terminal import complain, stepping_aside
from denseface.service.runtime.terminal.progress import can_move, duration
from denseface.service.tools.batch.row import Row, State

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

__all__ = ["BatchProgress", "Rate"]

_FIRST_S, _EVERY_S = 10.0, 60.0
"""Until the first plain line and between later ones, seconds."""
_WINDOW_S = 60.0
"""Over which the rate is told: chunks come in bursts, and machines come and go."""
_REFRESHES = 4
"""Of the bar, each second."""
_LEAST_BAR = 80
"""Columns of a terminal that has room for a bar beside the words."""
_WORDS: dict[State, str] = {
    "no_face": "without a face", "unreadable": "unreadable", "failed": "failed"}


class Rate:
    """How many frames are done in a second, of the last minute.

    Parameters
    ----------
    clock : monotonic, seconds
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._marks = deque([(clock(), 0)])
        """Times and how many were done then; at most one in each hundredth of the window."""

    def add(self, done: int) -> None:
        """So many are done now."""
        now = self._clock()
        while len(self._marks) > 1 and self._marks[1][0] <= now - _WINDOW_S:
            self._marks.popleft()
        if now - self._marks[-1][0] >= _WINDOW_S / 100:
            self._marks.append((now, done))

    def of(self, done: int) -> float:
        """Give the frames a second; 0 where nothing was done."""
        since, before = self._marks[0]
        elapsed = self._clock() - since
        return (done - before) / elapsed if elapsed > 0 else 0.0


class BatchProgress:
    """How far an archive is, from the beginning of the `with` block to its end.

    Parameters
    ----------
    total : frames that there are, with those that were done before; None where that is not known
    before : of them done by earlier runs; they count as done, not in the rate
    clock : monotonic, seconds
    """

    def __init__(
        self, total: int | None = None, *, before: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.total = total
        """May be set when it is known."""
        self._before, self._done = before, 0
        self._states: dict[State, int] = {}
        self._clock = clock
        self._begun_s = clock()
        self._rate = Rate(clock)
        self._ended = threading.Event()
        self._opened = ExitStack()
        self._live: Live | None = None

    def __enter__(self) -> Self:
        if can_move(sys.stderr):
            self._live = _live(self._drawn)
            self._opened.enter_context(stepping_aside(self._aside))
            self._live.start()
        elif sys.stderr is not None:
            threading.Thread(target=self._tell_on, name="batch progress", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._opened.close()
        if self._live is not None:
            self._live.stop()

    def add(self, row: Row) -> None:
        """One more frame is done."""
        self._done += 1
        if row.state != "face":
            self._states[row.state] = self._states.get(row.state, 0) + 1
        self._rate.add(self._done)

    def text(self) -> str:
        """Say in a line how far it is."""
        return ", ".join([self._counted(), *self._told()])

    def _counted(self) -> str:
        done = self._before + self._done
        if not self.total:
            return f"{done:,} frames"
        return f"{done:,} of {self.total:,} frames ({100 * min(done, self.total) // self.total} %)"

    def _told(self) -> list[str]:
        parts = []
        if rate := self._rate.of(self._done):
            parts.append(f"{rate:.1f} a second" if rate >= 1 else f"{duration(1 / rate)} each")
            if self.total and (left := self.total - self._before - self._done) > 0:
                parts.append(f"about {duration(left / rate)} left")
        else:
            parts.append(duration(self._clock() - self._begun_s))
        return parts + [f"{self._states[state]:,} {words}" for state, words in _WORDS.items()
                        if state in self._states]

    def _tell_on(self) -> None:
        wait_s = _FIRST_S
        while not self._ended.wait(wait_s):
            complain(f"batch: {self.text()}")
            wait_s = _EVERY_S

    def _drawn(self) -> "Table":
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        line = Table.grid(expand=True, padding=(0, 1))
        words = Text(self.text(), no_wrap=True, overflow="ellipsis")
        if self._live is not None and self._live.console.width < _LEAST_BAR:
            line.add_column(ratio=1)
            line.add_row(words)
            return line
        line.add_column(ratio=1)
        line.add_column(no_wrap=True)
        line.add_row(ProgressBar(
            total=self.total, completed=self._before + self._done, pulse=not self.total), words)
        return line

    @contextmanager
    def _aside(self) -> Iterator[None]:
        """Take the bar away while a line is printed, and draw it anew below."""
        live = self._live
        if live is None or not live.is_started:
            yield
            return
        live.stop()
        try:
            yield
        finally:
            if not self._ended.is_set():
                live.start(refresh=True)


def _live(drawn: "Callable[[], Table]") -> "Live":
    from rich.console import Console
    from rich.live import Live

    return Live(
        console=Console(stderr=True), get_renderable=drawn, transient=True,
        refresh_per_second=_REFRESHES, redirect_stdout=False, redirect_stderr=False)
