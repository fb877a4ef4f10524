"""Stores a frame or a face in one call: its file, then its row."""

from denseface.recon.settings import Settings
from denseface.service.errors import StoreError
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore, write

__all__ = ["accept", "finish"]


def accept(store: FolderStore, frame: Packet, settings: Settings, settings_hash: str) -> None:
    """Store a `Frame`; raises what the writer or the store does."""
    (written,) = write([store.prepare_frame(frame, settings, settings_hash)])
    try:
        if written.error:
            raise written.error
        store.accept([written], CaptureState.ACCEPTED)
    except StoreError:
        store.refuse([written.pending])
        raise


def finish(store: FolderStore, result: Packet) -> None:
    """Store a `Result`; raises as `accept`."""
    (written,) = write([store.prepare_face(result)])
    if written.error:
        raise written.error
    store.finish([written], CaptureState.DONE)
