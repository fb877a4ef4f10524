"""Kernels are compiled by one process at a time, while others wait; and all of it is said.

It goes to the logger `denseface.kernels`, with a `Progress` as the record's attribute `progress`:
warnings when it begins and ends, between them an info for each kernel. Who has configured no
logging sees the two on stderr.
"""

import fcntl
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

__all__ = ["LOGGER", "Compiling", "Kernel", "Progress", "compiling", "nowhere"]

LOGGER = "denseface.kernels"
_POLL_S = 0.1
"""Time between two looks at whether another process is done, seconds."""
_PATIENCE_S = 120.0
"""Longest time that another may take for one kernel, seconds: it may be stopped."""
_LINE_BYTES = 64
"""Longest line in the file that is locked: what its holder has done, and of how many."""


class Kernel(Protocol):
    """A compiled function."""

    @property
    def signatures(self) -> Sequence[object]:
        """Types for which it stands compiled."""


@dataclass(frozen=True)
class Progress:
    """How far it is."""

    state: Literal["waiting", "compiling", "compiled"]
    """While `waiting`, another process compiles."""
    done: int
    """Kernels that stand ready."""
    total: int
    seconds: float = 0.0
    """Since it began."""
    not_kept: str = ""
    """Why the code could be kept nowhere; empty where it was."""

    def __str__(self) -> str:
        match self.state:
            case "waiting":
                who = "another process compiles the kernels, waiting for it"
            case "compiling":
                who = "compiling kernels, once on this machine"
            case "compiled":
                return f"kernels ready after {self.seconds:.0f} s" + (
                    f", for this start alone: {nowhere(self.not_kept)}" if self.not_kept else "")
        return f"{who}: {self.done} of {self.total}"


def nowhere(reason: str) -> str:
    """Say that code cannot be kept, why, and what to do."""
    return ("compiled kernels can be kept nowhere; set NUMBA_CACHE_DIR to a folder that only you "
            f"can write ({reason})")


class Compiling:
    """The compiling of this process: called by its kernels' cache, in numba's lock."""

    def __init__(self) -> None:
        self._kernels: list[Kernel] = []
        self._sessions = 0
        self._guard = threading.Lock()
        self._turn: int | None = None
        """Descriptor of the locked file, -1 where none could be locked; None out of turn."""
        self._begun: float | None = None
        """When waiting or compiling began, monotonic clock, seconds; None while it has not."""
        self._not_kept = ""
        self.compiled = 0
        """How often this process compiled."""
        self.folders: set[Path] = set()
        """Where the code is that it loaded or kept."""
        self.lost = ""
        """Why some of it is kept nowhere; empty where all of it is."""
        self.progress: Progress | None = None
        """The last that was said; None where nothing is compiled, and nothing waited for."""
        self._log = logging.getLogger(LOGGER)

    def __len__(self) -> int:
        """How many kernels there are."""
        return len(self._kernels)

    def add(self, kernel: Kernel) -> None:
        """Count one more kernel."""
        self._kernels.append(kernel)

    @contextmanager
    def session(self) -> Iterator[None]:
        """Say what is compiled in this block, as one; what is compiled outside is not told."""
        with self._guard:
            self._sessions += 1
        try:
            yield
        finally:
            with self._guard:
                self._sessions -= 1
                last = self._sessions == 0
            if last:
                self._end()

    def take_turn(self, folder: Callable[[], Path | None]) -> bool:
        """Wait until no other process compiles; False where that was done before.

        Parameters
        ----------
        folder : gives where the processes that share their code find the file to lock
        """
        if self._turn is not None:
            return False
        self._turn = -1
        with suppress(OSError):  # nowhere to write, or a file system without locks
            if (where := folder()) is not None:
                self._turn = self._lock(where / "denseface.lock")
        return True

    def give_turn(self) -> None:
        """Let others compile."""
        turn, self._turn = self._turn, None
        if turn is not None and turn >= 0:
            os.close(turn)

    def begin_one(self) -> None:
        """Say that a kernel is to be compiled."""
        if self._begun is None and self._sessions:
            self._begun = time.monotonic()
            self._say(logging.WARNING, self._progress("compiling"))

    def end_one(self, not_kept: str) -> None:
        """Say that a kernel was compiled, and why its code was not kept."""
        self.compiled += 1
        self.lost = self.lost or not_kept
        self._not_kept = self._not_kept or not_kept
        if not self._sessions:
            self.give_turn()
        elif self._begun is not None:
            progress = self._progress("compiling")
            if self._turn is not None and self._turn >= 0:
                with suppress(OSError):
                    line = f"{progress.done} {progress.total}\n"
                    os.pwrite(self._turn, line.encode(), 0)
            self._say(logging.INFO, progress)

    def _end(self) -> None:
        if self._begun is not None:
            progress = self._progress("compiled")
            self._begun, self._not_kept = None, ""
            self._say(logging.WARNING, progress)
        self.give_turn()

    def _progress(self, state: Literal["compiling", "compiled"]) -> Progress:
        done = sum(bool(kernel.signatures) for kernel in self._kernels)
        return Progress(state, done, len(self._kernels),
                        time.monotonic() - (self._begun or 0.0), self._not_kept)

    def _say(self, level: int, progress: Progress) -> None:
        self.progress = progress if progress.state != "compiled" else None
        self._log.log(level, "%s", progress, extra={"progress": progress})

    def _lock(self, path: Path) -> int:
        """Give the descriptor of the file, locked; -1 where its holder does not get on."""
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        try:
            if self._wait(descriptor):
                os.truncate(descriptor, 0)
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)
        return -1

    def _wait(self, descriptor: int) -> bool:
        begun = heard = time.monotonic()
        last = None
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                pass
            else:
                return True
            now = time.monotonic()
            line = os.pread(descriptor, _LINE_BYTES, 0)
            if line != last:
                heard = now
                done, total = _read_counts(line) or (0, len(self._kernels))
                if self._sessions:
                    self._begun = self._begun or begun
                    self._say(logging.WARNING if last is None else logging.INFO,
                              Progress("waiting", done, total, now - begun))
                last = line
            if now - heard > _PATIENCE_S:
                return False
            time.sleep(_POLL_S)


def _read_counts(line: bytes) -> tuple[int, int] | None:
    done, _, total = line.strip().partition(b" ")
    return (int(done), int(total)) if done.isdigit() and total.isdigit() else None


compiling = Compiling()
"""Of this process."""
