"""Keeps a frame or a face in one go: its file, then its row."""

from denseface.recon.settings import Settings
from denseface.service.errors import StoreError
from denseface.service.protocol.wire import Packet
from denseface.service.storage.base import Store
from denseface.service.storage.writer import write

__all__ = ["accept", "finish"]


def accept(store: Store, frame: Packet, settings: Settings, settings_hash: str) -> None:
    """Keep a `Frame`; raises what the disk says."""
    (written,) = write([store.frame_draft(frame, settings, settings_hash)])
    if written.error:
        raise written.error
    try:
        store.accept([written])
    except StoreError:
        written.draft.discard()
        raise


def finish(store: Store, result: Packet) -> None:
    """Keep a `Result`; raises what the disk says."""
    (written,) = write([store.face_draft(result)])
    if written.error:
        raise written.error
    store.finish([written])
