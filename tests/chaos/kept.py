"""What is on the hub's disk when all is over, read without the hub."""

import sqlite3
from contextlib import closing
from pathlib import Path

from denseface.service.errors import StoreError
from denseface.service.storage import FolderLayout, read_face, read_frame
from tests.chaos.history import Kept

__all__ = ["read_kept"]


def read_kept(data: Path) -> list[Kept]:
    """Read every capture, and every file that belongs to one; the hub must have ended."""
    layout = FolderLayout(data)
    with closing(sqlite3.connect(layout.database)) as database:
        database.row_factory = sqlite3.Row
        rows = database.execute(
            "SELECT captures.*, outcomes.sequence, outcomes.face_sha256 FROM captures"
            " LEFT JOIN outcomes USING (capture_id) ORDER BY position").fetchall()
    return [Kept(row["capture_id"], row["state"], row["sequence"], _sound(layout, row))
            for row in rows]


def _sound(layout: FolderLayout, row: sqlite3.Row) -> bool:
    capture_id = row["capture_id"]
    try:
        frame = read_frame(layout.accepted_frame(capture_id), row["frame_sha256"])
        if row["face_sha256"] is None:
            return bool(frame.message.capture_id == capture_id)
        face = read_face(layout.face(capture_id, row["settings_hash"]), row["face_sha256"])
    except StoreError:
        return False
    return bool(face.message.capture_id == frame.message.capture_id == capture_id
                and face.message.frame_sha256 == row["frame_sha256"])
