"""What takes long says so on stderr: a line that moves on a terminal, a plain one elsewhere.

Nothing is ever written to stdout. There are no colours and no escape sequences, so that NO_COLOR
has nothing to forbid; a terminal that is `dumb` gets the plain line.
"""

import os
import sys
import threading
import time
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Self, TextIO

from denseface.service.runtime.terminal import _lines
from denseface.service.runtime.terminal._lines import complain, printable

__all__ = ["PLAIN_AFTER_S", "Progress", "can_move", "duration"]

PLAIN_AFTER_S = 2.0
"""Time after which something takes long enough to be said where no line can move, seconds."""
_MOVE_AFTER_S = 0.5
"""The same on a terminal, seconds: a line that comes and goes at once is a flicker."""
_REFRESH_S = 0.2
"""Time between two writings of the line that moves, seconds."""
_COLUMNS = 80
"""Of a terminal that does not know its own."""
_LEAST_WHAT = 16
"""Columns that are left to what is done, however much is told of it."""
_WIDE = "WF"
"""East Asian widths that take two columns (Unicode Standard Annex 11)."""

_lock = threading.RLock()
"""Held by whoever writes; a signal's handler may write within a line of its own thread."""
_running: list["Progress"] = []
"""The last one has the terminal; the one before has it again afterwards."""


class Progress:
    """One thing that may take long, from the beginning of the `with` block to its end.

    Parts are told by `advance`, from any thread; nothing need be told where one only waits. The
    line is gone at the end, whatever ends the block, and so is the thread that moves it.

    Parameters
    ----------
    what : what is done, such as `waiting for the hub at ipc:///run/hub`
    total : parts of which all consists; None where that is not known
    unit : what a part is, such as `files`
    plain_after_s : time until the plain line is due where no line can move, seconds
    clock : monotonic, seconds
    """

    def __init__(
        self, what: str, *, total: int | None = None, unit: str = "",
        plain_after_s: float = PLAIN_AFTER_S, clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.total = total
        self._what, self._unit = what, unit
        self._done: int | None = 0 if total is not None else None
        self._now: Callable[[], str] | None = None
        self._clock = clock
        self._begun_s = clock()
        self._stream = sys.stderr
        self._moves = can_move(self._stream)
        self._first_s = _MOVE_AFTER_S if self._moves else plain_after_s
        self._width = 0
        """Columns that the line has now."""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._write_on, name="progress", daemon=True)

    def __enter__(self) -> Self:
        with _lock:
            if _running:
                _running[-1]._clear()
            _running.append(self)
        if self._stream is not None:
            with suppress(RuntimeError):  # no thread can be had: it is done without a word
                self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        with _lock:
            if self in _running:  # not in a child that was forked within
                _running.remove(self)
            self._clear()
        if self._thread.is_alive():
            self._thread.join()

    def advance(self, parts: int = 1) -> None:
        """So many more parts are done."""
        with _lock:
            self._done = (self._done or 0) + parts

    def show(self, text: str | Callable[[], str]) -> None:
        """Say what is done now, behind the rest; a function is called when the line is written."""
        self._now = text if callable(text) else lambda: text

    def text(self) -> str:
        """Give the line, as it moves."""
        return f"{self._what}: {self._told()}"

    def _told(self) -> str:
        elapsed_s = self._clock() - self._begun_s
        done, now = self._done, self._now
        parts = [] if done is None else self._parts(done, elapsed_s)
        if now is not None:
            parts.append(now())
        return ", ".join(parts or [duration(elapsed_s)])

    def _parts(self, done: int, elapsed_s: float) -> list[str]:
        unit = f" {self._unit}" if self._unit else ""
        if not self.total:
            return [f"{done}{unit}, {duration(elapsed_s)}"]
        parts = [f"{done} of {self.total}{unit} ({100 * min(done, self.total) // self.total} %)"]
        if done > 0 and elapsed_s > 0:
            rate = done / elapsed_s
            parts.append(f"{rate:.1f} a second" if rate >= 1 else
                         f"{duration(1 / rate)} each")
            if (left := self.total - done) > 0:
                parts.append(f"about {duration(left / rate)} left")
        return parts

    def _write_on(self) -> None:
        if self._ended.wait(self._first_s):
            return
        if not self._moves:
            with _lock:
                if not self._ended.is_set():
                    complain(self._plain())
            return
        while True:
            with _lock:
                if not self._ended.is_set() and _running[-1] is self:
                    self._draw()
            if self._ended.wait(_REFRESH_S):
                return

    def _plain(self) -> str:
        total = f" {self.total} {self._unit}".rstrip() if self.total else ""
        now = f": {self._now()}" if self._now is not None else ""
        return f"{self._what}{':' if total else ''}{total}{now} ..."

    def _draw(self) -> None:
        columns = _columns(self._stream) - 1
        what, told = printable(self._what), printable(f": {self._told()}")
        # What moves is what is looked for: rather than its end, that of the beginning is cut.
        room = max(columns - _width(told), _LEAST_WHAT)
        if _width(what) > room:
            what = f"{_fit(what, room - 3)[0]}..."
        line, width = _fit(what + told, columns)
        self._write(f"\r{line}{' ' * (self._width - width)}")
        self._width = width

    def _clear(self) -> None:
        if self._width:
            self._write(f"\r{' ' * self._width}\r")
        self._width = 0

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            _lines.discard_unless_flushed(self._stream)


def duration(seconds: float) -> str:
    """Say a duration as people do: `8 s`, `3 min 20 s`, `2 h 5 min`."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


@contextmanager
def _aside() -> Iterator[None]:
    with _lock:
        if _running:
            _running[-1]._clear()
        yield


def _forget() -> None:
    """In a forked child there are no threads, and nobody gives back what they held."""
    global _lock
    _lock = threading.RLock()
    _running.clear()


_lines.step_aside_by(_aside)
os.register_at_fork(after_in_child=_forget)


def can_move(stream: TextIO | None) -> bool:
    """Say whether a line on a stream can be written over."""
    if stream is None or os.environ.get("TERM", "dumb") in {"", "dumb"}:
        return False
    try:
        return stream.isatty()
    except ValueError:  # closed
        return False


def _columns(stream: TextIO) -> int:
    try:
        return os.get_terminal_size(stream.fileno()).columns or _COLUMNS
    except (OSError, ValueError):
        return _COLUMNS


def _width(text: str) -> int:
    return _fit(text, 2 * len(text))[1]


def _fit(text: str, columns: int) -> tuple[str, int]:
    """Cut a text to what fits; also give its columns."""
    used = 0
    for at, one in enumerate(text):
        width = (0 if unicodedata.combining(one) else
                 2 if unicodedata.east_asian_width(one) in _WIDE else 1)
        if used + width > columns:
            return text[:at], used
        used += width
    return text, used
