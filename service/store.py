"""The data folder: frames and faces as files, what became of them in SQLite.

A file is written and synced before the row that names it, so a row never names what is not there.
Every call is durable when it returns.
"""

import fcntl
import os
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol, Self

from recon.settings import Settings
from service.errors import CorruptFileError, HubRunningError, StoreError
from service.messages import CaptureFailed, FaceDone, Frame, Result
from service.payload import Arrays, FrameHeader
from service.settings import private_folder
from service.spool import read_parts, write_parts
from service.states import CaptureState
from service.wire import Packet, decode_to_hub, encode

__all__ = ["FolderStore", "Store", "Stored"]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS meta (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS captures (
    position INTEGER PRIMARY KEY AUTOINCREMENT,
    capture_id TEXT NOT NULL UNIQUE,
    state TEXT NOT NULL,
    settings TEXT NOT NULL,
    settings_hash TEXT NOT NULL,
    attempts INTEGER NOT NULL DEFAULT 0,
    frame_sha256 TEXT NOT NULL,
    accepted_at TEXT NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS outcomes (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    capture_id TEXT NOT NULL REFERENCES captures (capture_id),
    settings_hash TEXT NOT NULL,
    face_sha256 TEXT,
    error TEXT,
    message TEXT,
    dead INTEGER NOT NULL DEFAULT 0,
    finished_at TEXT NOT NULL,
    UNIQUE (capture_id, settings_hash)
) STRICT;
"""


@dataclass(frozen=True)
class Stored:
    """A capture's row."""

    state: CaptureState
    settings_json: str
    settings_hash: str
    attempts: int


class Store(Protocol):
    """What the hub needs of a store; each call is durable when it returns, or raises StoreError."""

    @property
    def epoch(self) -> str:
        """Name of this store, as long as it lives."""

    def accept(self, frame: Packet, settings: Settings, settings_hash: str) -> None:
        """Keep a `Frame`."""

    def find(self, capture_id: str) -> Stored | None:
        """Give a capture's row."""

    def unfinished(self) -> list[str]:
        """Give the ids of what was accepted and has no outcome, oldest first."""

    def start_attempt(self, capture_id: str) -> int:
        """Count an attempt before it is made and give its number, from 1."""

    def frame(self, capture_id: str) -> tuple[FrameHeader, Arrays]:
        """Give the frame back; CorruptFileError where it is damaged."""

    def finish(self, result: Packet) -> None:
        """Keep a `Result` as the capture's outcome; a second one changes nothing."""

    def fail(self, capture_id: str, error: str, message: str, *, dead: bool) -> None:
        """Keep a failure as the capture's outcome."""

    def outcome(self, capture_id: str) -> Packet | None:
        """Give the outcome as `FaceDone` or `CaptureFailed`."""

    def outcome_after(self, sequence: int) -> Packet | None:
        """Give the first outcome after a sequence number."""

    def last_sequence(self) -> int:
        """Give the number of the last outcome, 0 where there is none."""

    def counts(self) -> dict[CaptureState, int]:
        """Give the number of captures in each state."""


class FolderStore:
    """A `Store` in a folder: `frames/`, `faces/`, `captures.sqlite3`."""

    def __init__(self, folder: Path) -> None:
        """Open or create.

        Raises
        ------
        HubRunningError
            Where another hub has this folder open.
        StoreError
            Where it cannot be read or written.
        """
        self._frames = private_folder(folder) / "frames"
        self._faces = folder / "faces"
        self._lock = _lock(folder / "lock")
        try:
            for sub in (self._frames, self._faces):
                for abandoned in private_folder(sub).glob(".*.tmp"):
                    abandoned.unlink()
            self._database = sqlite3.connect(folder / "captures.sqlite3", isolation_level=None)
            self._database.row_factory = sqlite3.Row
            self._database.executescript(
                "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"
                + _SCHEMA)
            self._database.execute(
                "INSERT OR IGNORE INTO meta VALUES ('epoch', ?)", (secrets.token_hex(8),))
            row = self._database.execute("SELECT value FROM meta WHERE name = 'epoch'").fetchone()
        except (sqlite3.Error, OSError) as error:
            os.close(self._lock)
            raise StoreError(f"{folder}: {error}") from error
        self._epoch = str(row["value"])

    @property
    def epoch(self) -> str:
        """Name of this store, as long as it lives."""
        return self._epoch

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._database.close()
        os.close(self._lock)

    def accept(self, frame: Packet, settings: Settings, settings_hash: str) -> None:
        """Keep a `Frame`."""
        message = frame.message
        if not isinstance(message, Frame):
            raise TypeError(f"a Frame is accepted, found {message.kind}")
        checksum = write_parts(self._frame_path(message.capture_id), encode(frame))
        with self._transaction() as database:
            database.execute(
                "INSERT INTO captures (capture_id, state, settings, settings_hash, frame_sha256,"
                " accepted_at) VALUES (?, ?, ?, ?, ?, ?)",
                (message.capture_id, CaptureState.ACCEPTED, settings.model_dump_json(),
                 settings_hash, checksum, _now()))

    def find(self, capture_id: str) -> Stored | None:
        """Give a capture's row."""
        row = self._one("SELECT * FROM captures WHERE capture_id = ?", capture_id)
        if row is None:
            return None
        return Stored(
            CaptureState(row["state"]), row["settings"], row["settings_hash"], row["attempts"])

    def unfinished(self) -> list[str]:
        """Give the ids of what was accepted and has no outcome, oldest first."""
        with self._transaction() as database:
            rows = database.execute(
                "SELECT capture_id FROM captures WHERE state = ? ORDER BY position",
                (CaptureState.ACCEPTED,)).fetchall()
        return [row["capture_id"] for row in rows]

    def start_attempt(self, capture_id: str) -> int:
        """Count an attempt before it is made and give its number, from 1."""
        row = self._one(
            "UPDATE captures SET attempts = attempts + 1 WHERE capture_id = ? RETURNING attempts",
            capture_id)
        if row is None:
            raise StoreError(f"capture {capture_id} is not in the store")
        return int(row["attempts"])

    def frame(self, capture_id: str) -> tuple[FrameHeader, Arrays]:
        """Give the frame back; CorruptFileError where it is damaged."""
        row = self._one("SELECT frame_sha256 FROM captures WHERE capture_id = ?", capture_id)
        if row is None:
            raise StoreError(f"capture {capture_id} is not in the store")
        path = self._frame_path(capture_id)
        stored = decode_to_hub(read_parts(path, row["frame_sha256"]))
        if not isinstance(stored.message, Frame):
            raise CorruptFileError(f"{path}: holds a {stored.message.kind}, a frame expected")
        return stored.message.frame, stored.arrays

    def finish(self, result: Packet) -> None:
        """Keep a `Result` as the capture's outcome; a second one changes nothing."""
        message = result.message
        if not isinstance(message, Result):
            raise TypeError(f"a Result finishes a capture, found {message.kind}")
        checksum = write_parts(
            self._face_path(message.capture_id, message.settings_hash), encode(result))
        self._conclude(message.capture_id, CaptureState.DONE, face_sha256=checksum)

    def fail(self, capture_id: str, error: str, message: str, *, dead: bool) -> None:
        """Keep a failure as the capture's outcome."""
        state = CaptureState.DEAD if dead else CaptureState.FAILED
        self._conclude(capture_id, state, error=error, message=message)

    def outcome(self, capture_id: str) -> Packet | None:
        """Give the outcome as `FaceDone` or `CaptureFailed`."""
        return self._outcome(self._one(
            "SELECT * FROM outcomes WHERE capture_id = ? ORDER BY sequence DESC", capture_id))

    def outcome_after(self, sequence: int) -> Packet | None:
        """Give the first outcome after a sequence number."""
        return self._outcome(self._one(
            "SELECT * FROM outcomes WHERE sequence > ? ORDER BY sequence", sequence))

    def last_sequence(self) -> int:
        """Give the number of the last outcome, 0 where there is none."""
        row = self._one("SELECT coalesce(max(sequence), 0) AS last FROM outcomes")
        return int(row["last"]) if row else 0

    def counts(self) -> dict[CaptureState, int]:
        """Give the number of captures in each state."""
        with self._transaction() as database:
            rows = database.execute("SELECT state, count(*) FROM captures GROUP BY state")
            return {CaptureState(state): count for state, count in rows.fetchall()}

    def _conclude(
        self, capture_id: str, state: CaptureState, *, face_sha256: str | None = None,
        error: str | None = None, message: str | None = None,
    ) -> None:
        with self._transaction() as database:
            database.execute(
                "INSERT OR IGNORE INTO outcomes (capture_id, settings_hash, face_sha256, error,"
                " message, dead, finished_at) SELECT capture_id, settings_hash, ?, ?, ?, ?, ?"
                " FROM captures WHERE capture_id = ?",
                (face_sha256, error, message, state is CaptureState.DEAD, _now(), capture_id))
            database.execute(
                "UPDATE captures SET state = ? WHERE capture_id = ? AND state = ?",
                (state, capture_id, CaptureState.ACCEPTED))

    def _outcome(self, row: sqlite3.Row | None) -> Packet | None:
        if row is None:
            return None
        common = {"epoch": self._epoch, "sequence": row["sequence"],
                  "capture_id": row["capture_id"]}
        if row["face_sha256"] is None:
            return Packet(CaptureFailed(
                **common, error=row["error"], message=row["message"], dead=bool(row["dead"])))
        path = self._face_path(row["capture_id"], row["settings_hash"])
        stored = decode_to_hub(read_parts(path, row["face_sha256"]))
        if not isinstance(stored.message, Result):
            raise CorruptFileError(f"{path}: holds a {stored.message.kind}, a result expected")
        return Packet(FaceDone(**common, face=stored.message.face), stored.arrays)

    def _frame_path(self, capture_id: str) -> Path:
        return self._frames / f"{capture_id}.frame"

    def _face_path(self, capture_id: str, settings_hash: str) -> Path:
        return self._faces / f"{capture_id}.{settings_hash}.face"

    def _one(self, statement: str, *values: str | int) -> sqlite3.Row | None:
        with self._transaction() as database:
            row: sqlite3.Row | None = database.execute(statement, values).fetchone()
        return row

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        try:
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield self._database
            except BaseException:
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")
                raise
            self._database.execute("COMMIT")
        except sqlite3.Error as error:
            raise StoreError(f"captures.sqlite3: {error}") from error


def _lock(path: Path) -> int:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror or error}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise HubRunningError(f"{path.parent}: another hub has this data folder open") from error
    return descriptor


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
