"""The data folder: frames and faces as files, what became of them in SQLite."""

from denseface.service.storage._capture_rows import CaptureRow
from denseface.service.storage._erasure import Erased, PendingErasure
from denseface.service.storage._folder_layout import FolderLayout, kept_bytes
from denseface.service.storage._recovery import Progress
from denseface.service.storage.folder_store import FolderStore, OpeningStore
from denseface.service.storage.records import (
    FaceMetadata,
    FrameMetadata,
    PendingWrite,
    read_face,
    read_frame,
)
from denseface.service.storage.writer import InlineWriter, Writer, WriteResult, WriterThreads, write

__all__ = [
    "CaptureRow",
    "Erased",
    "FaceMetadata",
    "FolderLayout",
    "FolderStore",
    "FrameMetadata",
    "InlineWriter",
    "OpeningStore",
    "PendingErasure",
    "PendingWrite",
    "Progress",
    "WriteResult",
    "Writer",
    "WriterThreads",
    "kept_bytes",
    "read_face",
    "read_frame",
    "write",
]
