"""Faces in memory that are not safe: being written, or refused by the disk."""

from denseface.service.errors import StoreError
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore, PendingWrite, Writer

_MAX_UNSAVED = 16
"""Faces in memory, beyond which no job is sent and a face that the disk refuses is dropped."""


class UnsavedFaces:
    """Faces of captures that are SAVING_FACE."""

    def __init__(self, store: FolderStore, writer: Writer) -> None:
        self._store = store
        self._writer = writer
        self._pending: dict[str, PendingWrite] = {}
        self._refused: dict[str, bool] = {}
        """Those that the disk refused, in order; True where one is being written again."""

    def __len__(self) -> int:
        return len(self._pending)

    def save(self, result: Packet) -> None:
        """Begin to write a face; StoreError where its capture waits for none."""
        pending = self._store.prepare_face(result)
        self._pending[pending.capture_id] = pending
        self._writer.start(pending)

    def retry_refused(self) -> bool:
        """Write again what the disk refused; True where there is room for more faces.

        StoreError where the store cannot be read.
        """
        for capture_id, again in self._refused.items():
            if not again:
                self.save(self._pending[capture_id].packet)  # its retention begins now
                self._refused[capture_id] = True
        return not self._refused and len(self._pending) < _MAX_UNSAVED

    def refused(self, capture_id: str, error: Exception) -> bool:
        """Note why a face could not be saved; True where it waits here for another try."""
        self._refused[capture_id] = False
        if isinstance(error, StoreError) and len(self._refused) <= _MAX_UNSAVED:
            return True
        self.drop(capture_id)
        return False

    def drop(self, capture_id: str) -> None:
        """Forget a face that is safe or whose capture was removed; it must not be being written."""
        self._pending.pop(capture_id, None)
        self._refused.pop(capture_id, None)
