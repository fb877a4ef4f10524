"""The last words of a worker: which frame it had, and how it ended.

A process that crashes, hangs or is killed answers nothing. So each writes down what it is about to
do, in a file of its own in the batch's folder; Python's `faulthandler` adds to it, without a lock
and without memory, what the system's signal was, or that a frame took too long, and ends the
process then, whatever it waits for.
"""

import faulthandler
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

__all__ = ["WORDS", "LastWords", "Said", "last_words", "worker_name"]

WORDS = ".workers"
"""Folder of a batch's folder."""
_LONGEST = 1 << 16
"""Bytes that are read of one."""
_END = ".txt"


class LastWords:
    """Where this process writes; made once, and kept open."""

    def __init__(self, folder: Path) -> None:
        path = folder / WORDS
        path.mkdir(mode=0o700, exist_ok=True)
        self._file = os.open(path / (worker_name().replace(":", "-") + _END),
                             os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
        faulthandler.enable(self._file, all_threads=False)

    @contextmanager
    def about(self, source: str, frame: int, name: str, limit_s: float) -> Iterator[None]:
        """Do something within the block that ends this process where it takes longer.

        Parameters
        ----------
        name : of the frame's files below the folder of faces
        """
        os.ftruncate(self._file, 0)
        os.write(self._file, json.dumps([source, frame, name, limit_s]).encode() + b"\n")
        faulthandler.dump_traceback_later(limit_s, file=self._file, exit=True)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            os.ftruncate(self._file, 0)

    def there(self) -> bool:
        """Say whether others see what is written: a batch takes the files away at its end."""
        return os.fstat(self._file).st_nlink > 0

    def close(self) -> None:
        """Say nothing any more."""
        faulthandler.disable()
        os.close(self._file)


class Said(NamedTuple):
    """What one left behind that did not come back."""

    path: Path
    source: str
    frame: int
    name: str
    error: str
    """What is to stand in the frame's row as its error."""
    why: str


def last_words(folder: Path) -> Iterator[Said]:
    """Read what there is, also of workers that live; what cannot be read is passed over."""
    with suppress(OSError):
        for path in (folder / WORDS).glob(f"*{_END}"):
            with suppress(OSError, ValueError, TypeError):
                with path.open(errors="replace") as file:
                    text = file.read(_LONGEST)
                first, _, rest = text.partition("\n")
                source, frame, name, limit_s = json.loads(first)
                yield Said(path, source, int(frame), name, *_why(rest, float(limit_s)))


def worker_name() -> str:
    """Give this process a name that no other of the batch has."""
    return f"{socket.gethostname()}:{os.getpid()}"


def _why(said: str, limit_s: float) -> tuple[str, str]:
    if said.startswith("Timeout ("):
        return "TimeLimit", f"its worker took longer than {limit_s:g} s for it, and was ended"
    fatal, found, rest = said.partition("Fatal Python error: ")
    if found and not fatal:
        return "WorkerCrashed", f"its worker crashed: {rest.partition(chr(10))[0]}"
    return "WorkerKilled", "its worker was killed while it made it, as where memory runs out"
