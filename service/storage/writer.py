"""Frames and faces are written beside the hub's loop, which goes on meanwhile.

What a `Writer` gives back is a file that is safe with its name, or why it is not. The row that
makes it count is the hub's to write, in its own thread, and so is all that is said of it.
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
from denseface.service.storage.record_file import store_error
from denseface.service.storage.records import FrameMetadata, PendingWrite

__all__ = ["InlineWriter", "WriteResult", "Writer", "WriterThreads", "write"]

_BATCH = 8
"""Most files that one sync of their folder is shared by: the first waits for the last."""


@dataclass(frozen=True)
class WriteResult:
    """What became of a `PendingWrite`."""

    pending: PendingWrite
    checksum: str = ""
    """Of its file, where there is no error."""
    error: Exception | None = None
    """A StoreError where the disk refused."""


class Writer(Protocol):
    """Writes files; those of one kind in the order in which they came."""

    def start(self, pending: PendingWrite) -> None:
        """Begin to write one."""

    def take_results(self) -> list[WriteResult]:
        """Give what has ended since the last call."""

    def wait(self) -> None:
        """Wait until all that was begun has ended."""


def write(pending_writes: Sequence[PendingWrite]) -> list[WriteResult]:
    """Write and sync files, then each of their folders once; nothing stays of a frame that fails.

    Whatever is raised is in what is given back.
    """
    written = [_write(pending) for pending in pending_writes]
    failed = {folder: error for folder in {one.pending.path.parent for one in written
                                           if one.error is None} if (error := _sync(folder))}
    written = [one if one.error else WriteResult(
        one.pending, one.checksum, failed.get(one.pending.path.parent)) for one in written]
    for one in written:
        if one.error is None:
            failpoint(f"{one.pending.steps}.named")
        elif isinstance(one.pending.metadata, FrameMetadata):
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
    """Writes in the thread that asks for it."""

    def __init__(self) -> None:
        self._done: list[WriteResult] = []

    def start(self, pending: PendingWrite) -> None:
        """Write."""
        self._done += write([pending])

    def take_results(self) -> list[WriteResult]:
        """Give what was written."""
        done, self._done = self._done, []
        return done

    def wait(self) -> None:
        """Do nothing: it has ended."""


class WriterThreads(Closing):
    """Writes frames in one thread and faces in another.

    A presser waits for a frame, so none waits for a face. What has ended makes `fileno` readable
    until it is taken.
    """

    def __init__(self) -> None:
        self._wake = WakePipe()
        self._closed = False
        self._changed = threading.Condition()
        self._begun = 0
        self._done: list[WriteResult] = []
        self._frames = _Lane("frames", self._ended)
        self._faces = _Lane("faces", self._ended)

    def fileno(self) -> int:
        """Give the descriptor that is readable where something has ended."""
        return self._wake.fileno()

    def has_results(self) -> bool:
        """Whether `take_results` would give anything; `fileno` is readable as long as it would."""
        with self._changed:
            return bool(self._done)

    def start(self, pending: PendingWrite) -> None:
        """Begin to write one."""
        with self._changed:
            self._begun += 1
        (self._frames if isinstance(pending.metadata, FrameMetadata) else self._faces).put(pending)

    def take_results(self) -> list[WriteResult]:
        """Give what has ended since the last call."""
        with self._changed:
            done, self._done = self._done, []
            if done and not self._closed:
                self._wake.drain()
        return done

    def wait(self) -> None:
        """Wait until all that was begun has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._begun == 0)

    def _ended(self, written: list[WriteResult]) -> None:
        with self._changed:
            self._begun -= len(written)
            self._done += written
            self._wake.wake()
            self._changed.notify_all()

    def close(self) -> None:
        """Write what was begun and end both threads; `take_results` still gives it."""
        for lane in (self._frames, self._faces):
            lane.close()
        self._wake.close()
        self._closed = True


class _Lane:
    def __init__(self, name: str, ended: Callable[[list[WriteResult]], None]) -> None:
        self._ended = ended
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
                while len(batch) < _BATCH and (pending := self._waiting.get_nowait()) is not None:
                    batch.append(pending)
            self._ended(write(batch))
            if pending is None:
                return
