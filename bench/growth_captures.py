"""Fills a data folder with many small captures, quickly, by the layout of its files alone."""

import hashlib
import secrets
import sqlite3
import struct
import zlib
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from denseface.recon.settings import Settings
from denseface.service.hub import settings_hash
from denseface.service.protocol import messages
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore
from tests.unit.service.faces import small_face, small_frame
from tests.unit.service.storing import accept, finish

__all__ = ["fill"]

_ID = "0" * 22
"""Id of the capture whose files are copied under other ids of its length."""
_START = len(b"denseface spool 3\n")
"""Where a file's checksum begins."""
_EVERY_DEAD = 10
"""One in so many is a dead letter, one has no face in its frame."""


def fill(data: Path, count: int) -> list[str]:
    """Keep that many captures in a data folder, as a hub leaves it that was stopped; their ids.

    Eight in ten have a face, one has none, one is a dead letter.
    """
    with FolderStore(data) as store:
        header, arrays = FrameHeader.of(small_frame())
        accept(store, Packet(messages.Frame(capture_id=_ID, frame=header), arrays), Settings(),
               settings_hash(Settings()))
        kept = store.find(_ID)
        if kept is None:
            raise RuntimeError("the store lost a frame")
        found, clouds = FaceHeader.of(small_face())
        finish(store, Packet(messages.Result(
            capture_id=_ID, settings_hash=kept.settings_hash, frame_sha256=kept.frame_sha256,
            face=found), clouds))
    (frame,), (face,) = (data / "frames").iterdir(), (data / "faces").iterdir()
    templates = _Template.of(frame), _Template.of(face)
    with closing(sqlite3.connect(data / "captures.sqlite3", isolation_level=None)) as database:
        database.execute("BEGIN")
        made = [_ID, *(_add(database, templates, kept.frame_sha256, number)
                       for number in range(count - 1))]
        database.execute("COMMIT")
    return made


@dataclass(frozen=True)
class _Template:
    """The parts of one file, its name and its folder."""

    folder: Path
    name: str
    parts: tuple[bytes, ...]

    @classmethod
    def of(cls, path: Path) -> "_Template":
        content = path.read_bytes()
        body = _START + hashlib.sha256().digest_size
        (count,) = struct.unpack_from("<I", content, body)
        lengths = struct.unpack_from(f"<{count}Q", content, body + 4)
        parts, start = [], body + 4 + 8 * count
        for length in lengths:
            parts.append(content[start:start + length])
            start += length
        return cls(path.parent, path.name, tuple(parts))

    def write(self, *replaced: tuple[str, str]) -> str:
        """Write the file with other words of the same length in its header; its checksum."""
        metadata, header, *arrays = self.parts
        name = self.name
        for old, new in replaced:
            header = header.replace(old.encode(), new.encode())
            name = name.replace(old, new)
        parts = [metadata, header, *arrays]
        index = struct.pack(f"<I{len(parts)}Q", len(parts), *map(len, parts))
        sums = struct.pack(f"<{len(parts)}I", *map(zlib.crc32, parts))
        digest = hashlib.sha256(index + sums)
        (self.folder / name).write_bytes(
            b"".join([b"denseface spool 3\n", digest.digest(), index, *parts]))
        return digest.hexdigest()


def _add(
    database: sqlite3.Connection, templates: tuple[_Template, _Template], frame_sha256: str,
    number: int,
) -> str:
    frame, face = templates
    capture_id = secrets.token_hex(11)
    checksum = frame.write((_ID, capture_id))
    match number % _EVERY_DEAD:
        case 0:
            state, outcome = "dead", (None, "WorkerLost", "the worker went away", 1)
        case 1:
            state, outcome = "failed", (None, "NoFaceError", "no face", 0)
        case _:
            made = face.write((_ID, capture_id), (frame_sha256, checksum))
            state, outcome = "done", (made, None, None, 0)
    database.execute(
        "INSERT INTO captures (capture_id, state, settings_hash, frame_sha256, accepted_at,"
        " pressed_by) SELECT ?, ?, settings_hash, ?, accepted_at, pressed_by FROM captures"
        " WHERE capture_id = ?", (capture_id, state, checksum, _ID))
    database.execute(
        "INSERT INTO outcomes (capture_id, face_sha256, error, message, dead, finished_at,"
        " finished_age_s) SELECT ?, ?, ?, ?, ?, finished_at, finished_age_s FROM outcomes"
        " WHERE capture_id = ?", (capture_id, *outcome, _ID))
    return capture_id
