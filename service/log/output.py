"""Where the log goes: never in the way of whoever logs.

stderr may be a file on a full disk, a pipe whose reader has stopped or left, or closed. A thread
writes; nobody waits for it. A line that cannot be written is lost and counted.
"""

import atexit
import io
import os
import select
import signal
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NoReturn

__all__ = ["LogOutput", "LogStream", "exit_now", "process_log"]

_STDERR = 2
_MAX_BYTES = 2**18
"""Lines in memory that are not yet written, bytes: a thousand or two."""
_FLUSH_S = 1.0
"""Longest wait at exit for lines that are not yet written, seconds."""
_INTERVAL_S = 1.0
"""Time between two calls of `on_interval`, seconds."""
_GATHER_S = 0.02
"""Time for which lines are gathered before they are written, seconds. A thread that wakes for each
of a capture's dozen lines takes Python's lock and a core from who computes."""
_MAX_PARTIAL = 2**14
"""Characters of a line without an end that are kept, waiting for its end."""


class LogOutput:
    """Writes lines to a descriptor in a thread; `put` never waits and never raises.

    The descriptor stays as it is: what it stands for is shared with other processes, so it must
    not be made non-blocking.

    Attributes
    ----------
    on_recovery : called in the thread with the number of lines lost since it was called last and
        since the start, when a line was written after some were lost; what it `put`s comes next
    on_interval : called in the thread once a second
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.on_interval: Callable[[], None] = lambda: None
        self.on_recovery: Callable[[int, int], None] = lambda _, __: None
        self._reset()
        os.register_at_fork(after_in_child=self._reset)

    def _reset(self) -> None:
        """Begin anew: a child has neither the thread nor, perhaps, the lock of its parent."""
        self._changed = threading.Condition()  # its lock may be taken again: logging is reentrant
        self._lines: deque[bytes] = deque()
        self._bytes = 0
        self._lost = self._told = 0
        self._torn = False
        self._gathering = self._hurried = False
        self._thread: threading.Thread | None = None
        self.kept: deque[bytes] = deque(maxlen=0)
        """The last lines, where `keep` was called: for whoever shows the log."""
        self._recovering: int | None = None
        """Number of the thread while it is in `on_recovery`."""

    @property
    def lost(self) -> int:
        """Lines lost since the start of this process."""
        return self._lost

    def keep(self, lines: int) -> None:
        """Keep so many of the last lines from now on."""
        self.kept = deque(self.kept, maxlen=lines)

    def put(self, line: str) -> None:
        """Write a line, without its end, some time later; for any thread."""
        data = (line + "\n").encode(errors="backslashreplace")
        self.kept.append(data)
        if self._recovering == threading.get_ident():
            self._lost += not self._write(data)
            return
        with self._changed:
            if self._bytes + len(data) > _MAX_BYTES or not self._running():
                self._lost += 1
                return
            self._lines.append(data)
            self._bytes += len(data)
            if not self._gathering or self._much():
                self._changed.notify_all()

    def _much(self) -> bool:
        return self._hurried or self._bytes > _MAX_BYTES // 4

    def flush(self, seconds: float = _FLUSH_S) -> None:
        """Wait until all lines are written or lost, but no longer than that."""
        with self._changed:
            self._hurried = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._lines, seconds)
            self._hurried = False

    def _running(self) -> bool:
        if self._thread is None:
            thread = threading.Thread(target=self._run, name="log", daemon=True)
            try:
                thread.start()
            except RuntimeError:  # the system allows no more, or the interpreter ends
                return False
            self._thread = thread
        return True

    def _run(self) -> None:
        # Signals are for the main thread. Besides, a terminal stops a process in the background
        # that writes to it and does not block SIGTTOU, where `stty tostop` was said.
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        due = time.monotonic() + _INTERVAL_S
        while True:
            with self._changed:
                if self._changed.wait_for(
                        lambda: self._lines, max(0.0, due - time.monotonic())):
                    self._gathering = True
                    self._changed.wait_for(self._much, _GATHER_S)
                    self._gathering = False
                lines = list(self._lines)
            for line in lines:
                self._write_first(line)
            if (now := time.monotonic()) >= due:
                due = now + _INTERVAL_S
                self.on_interval()

    def _write_first(self, line: bytes) -> None:
        """Write the first line of those that wait, or lose it; only now it waits no more."""
        written = self._write(line)
        with self._changed:
            self._lines.popleft()
            self._bytes -= len(line)
            self._lost += not written
            lost, told = self._lost, self._told
            if written:
                self._told = lost
            self._changed.notify_all()
        if written and lost > told:
            self._recovering = threading.get_ident()
            self.on_recovery(lost - told, lost)
            self._recovering = None

    def _write(self, line: bytes) -> bool:
        """Write a line and wait as long as that takes; False where it is lost, or a part of it."""
        left = line
        try:
            if self._torn:  # what follows a part of a line is a new line
                os.write(self._descriptor, b"\n")
                self._torn = False
            while left:
                try:
                    left = left[os.write(self._descriptor, left):]
                except BlockingIOError:  # another process has made it non-blocking
                    select.select((), (self._descriptor,), ())
        except OSError:
            self._torn |= len(left) < len(line)
            return False
        return True


class LogStream(io.TextIOBase):
    """In the place of `sys.stderr`: gives what is printed line by line to `put`."""

    encoding = "utf-8"
    errors = "backslashreplace"

    def __init__(self, put: Callable[[str], None]) -> None:
        self._put = put
        self._begun = threading.local()

    def write(self, text: str) -> int:
        """Take a text; what follows its last line break waits for this thread's next text."""
        *lines, begun = (getattr(self._begun, "line", "") + text).split("\n")
        if len(begun) > _MAX_PARTIAL:
            lines.append(begun)
            begun = ""
        self._begun.line = begun
        for line in lines:
            if line:
                self._put(line)
        return len(text)

    def writable(self) -> bool:
        """Say that it is."""
        return True

    def fileno(self) -> int:
        """Give the descriptor of stderr, for child processes."""
        return _STDERR

    def isatty(self) -> bool:
        """Say whether stderr is a terminal."""
        return os.isatty(_STDERR)


process_log = LogOutput(_STDERR)
"""This process's."""
atexit.register(process_log.flush)


def exit_now(status: int) -> NoReturn:
    """End this process without waiting for its threads, except for the log's, and that not long."""
    process_log.flush()
    os._exit(status)
