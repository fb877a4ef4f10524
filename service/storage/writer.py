"""Writes the files of frames and faces in threads of their own, so that the hub's loop goes on.

A `Writer` reports each file as safe under its name, or the error. The hub then writes the row, in
its own thread.
"""

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Protocol

from denseface.service.errors import StoreError
from denseface.service.runtime.closing import Closing
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.files import sync_folder
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.storage._record_file import store_error
from denseface.service.storage.records import PendingWrite

__all__ = ["InlineWriter", "WriteResult", "Writer", "WriterThreads", "write"]

_MAX_BATCH = 8
"""Files that share one sync of their folder; the first waits for the last."""


@dataclass(frozen=True)
class WriteResult:
    """What became of a `PendingWrite`."""

    pending: PendingWrite
    checksum: str = ""
    """Of the file; empty where there is an error."""
    error: Exception | None = None
    """A StoreError where the disk or file system failed."""


class Writer(Protocol):
    """Writes files; those of frames in order, and those of faces."""

    def start(self, pending: PendingWrite) -> None:
        """Begin to write a file."""

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""

    def wait(self) -> None:
        """Wait until every write has a result."""


def write(pending_writes: Sequence[PendingWrite]) -> list[WriteResult]:
    """Write and sync files, then each of their folders once; errors are in the results.

    The file of a frame that fails is removed.
    """
    written = [_write(pending) for pending in pending_writes]
    failed = {folder: error for folder in {one.pending.path.parent for one in written
                                           if one.error is None} if (error := _sync(folder))}
    written = [one if one.error else WriteResult(
        one.pending, one.checksum, failed.get(one.pending.path.parent)) for one in written]
    for one in written:
        if one.error is None:
            failpoint(f"{one.pending.failpoints}.named")
        elif one.pending.is_frame:
            one.pending.discard()
    return written


def _write(pending: PendingWrite) -> WriteResult:
    try:
        return WriteResult(pending, pending.write())
    except Exception as error:
        return WriteResult(pending, error=error)


def _sync(folder: Path) -> StoreError | None:
    try:
        sync_folder(folder)
    except OSError as error:
        return store_error(folder, error)
    return None


class InlineWriter:
    """Writes in the caller's thread."""

    def __init__(self) -> None:
        self._results: list[WriteResult] = []

    def start(self, pending: PendingWrite) -> None:
        """Write the file."""
        self._results += write([pending])

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""
        results, self._results = self._results, []
        return results

    def wait(self) -> None:
        """Return: every write has its result."""


class WriterThreads(Closing):
    """Writes frames in one thread and faces in another: a press does not wait for a face.

    `fileno` is readable while there are results.
    """

    def __init__(self) -> None:
        self._wake = WakePipe()
        self._closed = False
        self._changed = threading.Condition()
        self._unfinished = 0
        self._results: list[WriteResult] = []
        self._frames = _WriterThread("frames", self._finished)
        self._faces = _WriterThread("faces", self._finished)

    def fileno(self) -> int:
        """Give the descriptor to poll for reading."""
        return self._wake.fileno()

    def has_results(self) -> bool:
        """Whether `take_results` would give anything."""
        with self._changed:
            return bool(self._results)

    def start(self, pending: PendingWrite) -> None:
        """Begin to write a file."""
        with self._changed:
            self._unfinished += 1
        (self._frames if pending.is_frame else self._faces).put(pending)

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""
        with self._changed:
            results, self._results = self._results, []
            if results and not self._closed:
                self._wake.drain()
        return results

    def wait(self) -> None:
        """Wait until every write has a result."""
        with self._changed:
            self._changed.wait_for(lambda: self._unfinished == 0)

    def _finished(self, written: list[WriteResult]) -> None:
        with self._changed:
            self._unfinished -= len(written)
            self._results += written
            self._wake.wake()
            self._changed.notify_all()

    def close(self) -> None:
        """Finish every write and end both threads; `take_results` still gives the results."""
        for thread in (self._frames, self._faces):
            thread.close()
        self._wake.close()
        self._closed = True


class _WriterThread:
    def __init__(self, name: str, finished: Callable[[list[WriteResult]], None]) -> None:
        self._finished = finished
        self._waiting: SimpleQueue[PendingWrite | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, pending: PendingWrite) -> None:
        self._waiting.put(pending)

    def close(self) -> None:
        self._waiting.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (pending := self._waiting.get()) is not None:
            batch = [pending]
            with suppress(Empty):
                while len(batch) < _MAX_BATCH and (
                        pending := self._waiting.get_nowait()) is not None:
                    batch.append(pending)
            self._finished(write(batch))
            if pending is None:
                return
