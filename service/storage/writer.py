"""Writes and erases files in threads of their own, so that the hub's loop goes on.

A `Writer` reports each file as safe, or the error. The hub then writes the row, in
its own thread.
"""

import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Queue
from typing import Protocol, TypeAlias

from denseface.service.errors import StoreError
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.files import sync_folder
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.storage._erasure import Erased, PendingErasure
from denseface.service.storage._record_file import wrap_os_errors
from denseface.service.storage.records import MessageT, MetadataT, PendingWrite, Record

__all__ = ["InlineWriter", "WriteResult", "Writer", "WriterThreads", "write"]

_MAX_BATCH = 8
"""Files that share one sync of their folder; the first waits for the last."""
_Queue: TypeAlias = "Queue[PendingWrite | None]"
"""What waits to be written; None ends the thread."""


@dataclass(frozen=True)
class WriteResult:
    """What became of a `PendingWrite`."""

    pending: PendingWrite
    checksum: str = ""
    """Of the file; empty where there is an error."""
    error: Exception | None = None
    """A StoreError where the disk or file system failed."""

    def record(
        self, kind: type[MessageT], metadata_kind: type[MetadataT]
    ) -> Record[MessageT, MetadataT]:
        """Give what was written; TypeError where it is of another kind."""
        message, metadata = self.pending.packet.message, self.pending.metadata
        if not isinstance(message, kind) or not isinstance(metadata, metadata_kind):
            raise TypeError(f"expected a {kind.__name__}, found a {message.kind}")
        return Record(message, self.pending.packet.arrays, metadata, self.checksum)


class Writer(Protocol):
    """Writes files, those of frames in order, and those of faces; erases in order."""

    def start(self, pending: PendingWrite) -> None:
        """Begin to write a file."""

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""

    def erase(self, pending: PendingErasure) -> None:
        """Begin to erase."""

    def take_erased(self) -> list[Erased]:
        """Give what became of erasures since the last call."""

    def wait(self, *, erased: bool = False, timeout_s: float | None = None) -> bool:
        """Wait until every write has a result, and every erasure too if `erased`.

        False where a write has none after `timeout_s`: its disk hangs.
        """


def write(pending_writes: Sequence[PendingWrite]) -> list[WriteResult]:
    """Write and sync files, then each of their folders once; errors are in the results."""
    written = [_write(pending) for pending in pending_writes]
    failed: dict[Path, StoreError] = {}
    for folder in {one.pending.path.parent for one in written if one.error is None}:
        try:
            with wrap_os_errors(folder):
                sync_folder(folder)
        except StoreError as error:
            failed[folder] = error
    written = [one if one.error else WriteResult(
        one.pending, one.checksum, failed.get(one.pending.path.parent)) for one in written]
    for one in written:
        if one.error is None:
            failpoint(f"{one.pending.failpoints}.named")
    return written


def _write(pending: PendingWrite) -> WriteResult:
    try:
        checksum = pending.write()
        if not pending.is_frame:
            pending.name()
        return WriteResult(pending, checksum)
    except Exception as error:
        return WriteResult(pending, error=error)


class InlineWriter:
    """Writes in the caller's thread."""

    def __init__(self) -> None:
        self._results: list[WriteResult] = []
        self._erased: list[Erased] = []

    def start(self, pending: PendingWrite) -> None:
        """Write the file."""
        self._results += write([pending])

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""
        results, self._results = self._results, []
        return results

    def erase(self, pending: PendingErasure) -> None:
        """Erase."""
        self._erased.append(pending.run())

    def take_erased(self) -> list[Erased]:
        """Give what became of erasures since the last call."""
        erased, self._erased = self._erased, []
        return erased

    def wait(self, *, erased: bool = False, timeout_s: float | None = None) -> bool:  # noqa: ARG002
        """Return: all have their results."""
        return True


class WriterThreads(WakePipe):
    """Writes frames in one thread and faces in another: a press does not wait for a face.

    A third one erases. Readable while there are results.
    """

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._idle = threading.Condition(self._lock)
        self._under_way = 0
        """Writes without a result."""
        self._results: list[WriteResult] = []
        self._erased: list[Erased] = []
        self._awake = False
        """Whether the pipe was written to since it was drained."""
        self._closed = False
        self._frames: _Queue = Queue()
        self._faces: _Queue = Queue()
        self._erasures: Queue[PendingErasure | None] = Queue()
        self._threads = [
            threading.Thread(target=self._run, args=(queue,), name=name, daemon=True)
            for name, queue in (("frames", self._frames), ("faces", self._faces))]
        self._threads.append(
            threading.Thread(target=self._run_erasures, name="erasures", daemon=True))
        for thread in self._threads:
            thread.start()

    def has_results(self) -> bool:
        """Whether `take_results` or `take_erased` would give anything."""
        with self._lock:
            return bool(self._results or self._erased)

    def start(self, pending: PendingWrite) -> None:
        """Begin to write a file."""
        with self._lock:
            self._under_way += 1
        (self._frames if pending.is_frame else self._faces).put(pending)

    def take_results(self) -> list[WriteResult]:
        """Give the results since the last call."""
        with self._lock:
            results, self._results = self._results, []
            self._drained()
        return results

    def erase(self, pending: PendingErasure) -> None:
        """Begin to erase."""
        self._erasures.put(pending)

    def take_erased(self) -> list[Erased]:
        """Give what became of erasures since the last call."""
        with self._lock:
            erased, self._erased = self._erased, []
            self._drained()
        return erased

    def _drained(self) -> None:
        # A read of an empty pipe gives Python's lock away, and to get it back may take a while.
        if self._awake and not (self._results or self._erased or self._closed):
            self._awake = False
            self.drain()

    def _tell(self) -> None:
        self._awake = True
        self.wake()

    def wait(self, *, erased: bool = False, timeout_s: float | None = None) -> bool:
        """See `Writer`."""
        with self._idle:
            if not self._idle.wait_for(lambda: self._under_way == 0, timeout_s):
                return False
        if erased:
            self._erasures.join()
        return True

    def close(self) -> None:
        """Finish all and end the threads; `take_results` still gives the results."""
        for queue in (self._frames, self._faces):
            queue.put(None)
        self._erasures.put(None)
        for thread in self._threads:
            thread.join()
        self._closed = True
        super().close()

    def _run(self, queue: _Queue) -> None:
        going_on = True
        while going_on:
            batch = [queue.get()]
            with suppress(Empty):
                while len(batch) < _MAX_BATCH:
                    batch.append(queue.get_nowait())
            going_on = None not in batch
            results = write([one for one in batch if one])
            with self._lock:
                self._results += results
                self._under_way -= len(results)
                self._tell()
                self._idle.notify_all()

    def _run_erasures(self) -> None:
        while pending := self._erasures.get():
            erased = pending.run()
            with self._lock:
                self._erased.append(erased)
                self._tell()
            self._erasures.task_done()
