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
from denseface.service.storage.records import FrameAbout, PendingWrite

__all__ = ["InlineWriter", "WriteResult", "Writer", "WriterThreads", "write"]

_BATCH = 8
"""Most files that one sync of their folder is shared by: the first waits for the last."""


@dataclass(frozen=True)
class WriteResult:
    """What became of a draft."""

    draft: PendingWrite
    checksum: str = ""
    """Of its file, where there is no error."""
    error: Exception | None = None
    """A StoreError where the disk refused."""


class Writer(Protocol):
    """Writes the files of drafts; those of one kind in the order in which they came."""

    def start(self, draft: PendingWrite) -> None:
        """Begin to write one."""

    def take(self) -> list[WriteResult]:
        """Give what has ended since the last call."""

    def settle(self) -> None:
        """Wait until all that was begun has ended."""


def write(drafts: Sequence[PendingWrite]) -> list[WriteResult]:
    """Write and sync files, then each of their folders once; nothing stays of a frame that fails.

    Whatever is raised is in what is given back.
    """
    written = [_write(draft) for draft in drafts]
    failed = {folder: error for folder in {one.draft.path.parent for one in written
                                           if one.error is None} if (error := _sync(folder))}
    written = [one if one.error else WriteResult(
        one.draft, one.checksum, failed.get(one.draft.path.parent)) for one in written]
    for one in written:
        if one.error is None:
            failpoint(f"{one.draft.steps}.named")
        elif isinstance(one.draft.about, FrameAbout):
            one.draft.discard()
    return written


def _write(draft: PendingWrite) -> WriteResult:
    try:
        return WriteResult(draft, draft.write())
    except Exception as error:
        return WriteResult(draft, error=error)


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

    def start(self, draft: PendingWrite) -> None:
        """Write."""
        self._done += write([draft])

    def take(self) -> list[WriteResult]:
        """Give what was written."""
        done, self._done = self._done, []
        return done

    def settle(self) -> None:
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

    def any_ended(self) -> bool:
        """Whether `take` would give anything; `fileno` is readable as long as it would."""
        with self._changed:
            return bool(self._done)

    def start(self, draft: PendingWrite) -> None:
        """Begin to write one."""
        with self._changed:
            self._begun += 1
        (self._frames if isinstance(draft.about, FrameAbout) else self._faces).put(draft)

    def take(self) -> list[WriteResult]:
        """Give what has ended since the last call."""
        with self._changed:
            done, self._done = self._done, []
            if done and not self._closed:
                self._wake.drain()
        return done

    def settle(self) -> None:
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
        """Write what was begun and end both threads; `take` still gives it."""
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

    def put(self, draft: PendingWrite) -> None:
        self._waiting.put(draft)

    def close(self) -> None:
        self._waiting.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (draft := self._waiting.get()) is not None:
            batch = [draft]
            with suppress(Empty):
                while len(batch) < _BATCH and (draft := self._waiting.get_nowait()) is not None:
                    batch.append(draft)
            self._ended(write(batch))
            if draft is None:
                return
