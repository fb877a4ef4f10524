"""Rows that are not in `summary.parquet` yet: a stream of Arrow, to which each call adds.

What a killed process had written is there, but for a message that it had begun; the system may
lose the last seconds where the power goes.
"""

import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path

import pyarrow as pa

from denseface.service.errors import UsageError
from denseface.service.tools.batch.summary._failing import corrupt, named
from denseface.service.tools.batch.summary.schema import SCHEMA

__all__ = ["Journal", "read_stream"]

_NUMBER = b"denseface.run"
_MAX_BYTES = 2**28
"""Of a journal that is read; one of ours ends long before."""
_SYNC_S = 5.0
"""What the power may take, seconds."""
_FLAGS = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW


class Journal:
    """The journal of a folder, for one process at a time.

    Raises
    ------
    UsageError
        Another process has it.
    StoreError
        It cannot be read or written; so do all methods.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with named(path):
            self._descriptor = _locked(path)
        self._size = 0
        self._synced_s = time.monotonic()

    def read(self) -> tuple[int, pa.Table]:
        """Give its number, 0 of a new one, and what is whole of it."""
        with named(self.path):
            size = os.fstat(self._descriptor).st_size
            if size > _MAX_BYTES:
                raise corrupt(self.path, f"{size} bytes")
            data = os.pread(self._descriptor, size, 0)
        return read_stream(data)

    def begin(self, number: int) -> None:
        """Empty it, and give it a number."""
        head = SCHEMA.with_metadata({**SCHEMA.metadata, _NUMBER: str(number).encode()})
        with named(self.path):
            os.ftruncate(self._descriptor, 0)
            self._size = 0
            self._write(head.serialize())

    def append(self, batch: pa.RecordBatch) -> None:
        """Add rows; where that fails, nothing of them is left."""
        with named(self.path):
            self._write(batch.serialize())
            if time.monotonic() - self._synced_s >= _SYNC_S:
                os.fdatasync(self._descriptor)
                self._synced_s = time.monotonic()

    def _write(self, data: pa.Buffer) -> None:
        rest, at = memoryview(data), self._size
        try:
            while rest:
                written = os.pwrite(self._descriptor, rest, at)
                rest, at = rest[written:], at + written
        except BaseException:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise
        self._size = at

    def close(self, *, remove: bool = False) -> None:
        """Let others have it, or take it away."""
        if remove:
            with suppress(OSError):
                self.path.unlink()
        os.close(self._descriptor)


def _locked(path: Path) -> int:
    while True:
        descriptor = os.open(path, _FLAGS, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # The one before may have taken it away in the meantime.
            if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except BlockingIOError as error:
            os.close(descriptor)
            raise UsageError(f"{path.parent.parent}: another run writes its summary there: wait "
                             "until it ends, or name another folder") from error
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def read_stream(data: bytes | pa.Buffer) -> tuple[int, pa.Table]:
    """Give the number of a stream and its rows, up to what is torn; 0 and none of what is none."""
    batches: list[pa.RecordBatch] = []
    number = 0
    with suppress(pa.ArrowException, OSError, StopIteration):
        reader = pa.ipc.open_stream(data)
        said = (reader.schema.metadata or {}).get(_NUMBER, b"")
        if reader.schema.equals(SCHEMA) and said.isdigit() and len(said) <= 18:
            number = int(said)
            while True:
                batch = reader.read_next_batch()
                batch.validate(full=True)
                batches.append(batch)
    return number, pa.Table.from_batches(batches, SCHEMA).combine_chunks()
