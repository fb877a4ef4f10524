"""Faces that came and are not yet safe: being written, or refused by the disk."""

from collections.abc import Iterator, Sequence

import structlog

from denseface.service.errors import StoreError
from denseface.service.protocol.wire import Packet
from denseface.service.storage.folder_store import FolderStore
from denseface.service.storage.records import PendingWrite
from denseface.service.storage.writer import Writer, WriteResult

__all__ = ["UnsavedFaces"]

_MAX_UNSAVED = 16
"""Faces in memory; beyond it no work is begun, and one that the disk refuses is let go."""


class UnsavedFaces:
    """Captures that are CONCLUDING."""

    def __init__(self, store: FolderStore, writer: Writer) -> None:
        self._store = store
        self._writer = writer
        self._pending: dict[str, PendingWrite] = {}
        self._refused: dict[str, bool] = {}
        """Those that the disk refused, in order; True where one is being written again."""

    def __len__(self) -> int:
        return len(self._pending)

    def __contains__(self, capture_id: str) -> bool:
        return capture_id in self._pending

    def keep(self, result: Packet) -> None:
        """Begin to write a face; StoreError where it is of no use."""
        pending = self._store.prepare_face(result)
        self._pending[pending.capture_id] = pending
        self._writer.start(pending)

    def retry_refused(self) -> bool:
        """Begin anew to write what the disk refused; True where there is room for more faces.

        Raises
        ------
        StoreError
            Where the store cannot be read.
        """
        for capture_id, again in self._refused.items():
            if not again:
                self.keep(self._pending[capture_id].packet)  # its retention begins now
                self._refused[capture_id] = True
        return not self._refused and len(self._pending) < _MAX_UNSAVED

    def written(self, faces: Sequence[WriteResult]) -> list[tuple[str, Exception | None]]:
        """Give their rows to faces that were written, in order, and say of each what came of it.

        One that the disk refused stays, unless there are too many.
        """
        return list(self._written(faces))

    def _written(self, faces: Sequence[WriteResult]) -> Iterator[tuple[str, Exception | None]]:
        for one in faces:
            if one.error:
                yield one.pending.capture_id, self._not_kept(one.pending.capture_id, one.error)
        good = [one for one in faces if one.error is None]
        try:
            if len(good) > 1:  # one sync of the database for all
                self._store.finish(good)
                for one in good:
                    yield self._kept(one)
                return
        except StoreError as error:
            structlog.get_logger("hub").warning("faces are kept one by one", reason=str(error))
        for one in good:
            try:
                self._store.finish([one])
            except StoreError as error:
                yield one.pending.capture_id, self._not_kept(one.pending.capture_id, error)
            else:
                yield self._kept(one)

    def drop(self, capture_id: str) -> None:
        """Forget a capture that was removed; its face must not be under way."""
        self._pending.pop(capture_id, None)
        self._refused.pop(capture_id, None)

    def _kept(self, written: WriteResult) -> tuple[str, None]:
        self.drop(written.pending.capture_id)
        return written.pending.capture_id, None

    def _not_kept(self, capture_id: str, error: Exception) -> Exception:
        self._refused[capture_id] = False
        if not isinstance(error, StoreError) or len(self._refused) > _MAX_UNSAVED:
            self.drop(capture_id)
        return error
