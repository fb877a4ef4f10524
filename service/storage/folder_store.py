"""The data folder: frames and faces as files, what became of them in SQLite.

A file is written and synced before the row that names it, so a row never names what was not there.
"""

import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from sqlite3 import Connection

from denseface.recon.settings import Settings
from denseface.service.errors import (
    CorruptFileError,
    DamagedDatabaseError,
    DamagedFaceError,
    StoreError,
)
from denseface.service.protocol.messages import CaptureFailed, DeadLetter, FaceDone, Frame, Result
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.closing import Closing
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.files import private_folder
from denseface.service.storage.base import CaptureRow
from denseface.service.storage.folder_layout import FolderLayout
from denseface.service.storage.folder_lock import lock
from denseface.service.storage.frame_cache import FrameCache
from denseface.service.storage.record_file import naming, store_error
from denseface.service.storage.records import (
    FaceMetadata,
    FaceRecord,
    FrameMetadata,
    FrameRecord,
    PendingWrite,
    read_face,
    read_frame,
)
from denseface.service.storage.recovery import recover
from denseface.service.storage.retention import Retention
from denseface.service.storage.store_clock import Clock, SystemClock, stamp
from denseface.service.storage.writer import WriteResult

__all__ = ["FolderStore"]

_SHOWN = 300
"""Characters of an error that a list shows."""


class FolderStore(Closing):
    """A `Store` in a folder, mended where it is damaged.

    Parameters
    ----------
    folder : `frames/`, `faces/`, `quarantine/`, `captures.sqlite3`, `lock`; created where missing
    clock : tells how old things are

    Raises
    ------
    SettingsError
        Where it cannot be had.
    HubRunningError
        Where another hub has this folder open.
    StoreError
        Where it cannot be read or written.
    """

    def __init__(self, folder: Path, clock: Clock | None = None) -> None:
        with naming(folder):
            self._layout = FolderLayout(private_folder(folder))
        self._fresh = FrameCache()
        self._fresh_faces: dict[str, FaceRecord] = {}
        """Those that were kept last: they are published at once."""
        self._unread: set[str] = set()
        """Captures whose face was published from memory and never read from its file."""
        self._lock = lock(self._layout.lock)
        try:
            self._database, self._account, self._quarantine = recover(
                self._layout, clock or SystemClock())
            self._epoch = self._database.meta("epoch") or ""
            self._found: tuple[tuple[str, int], CaptureRow | None] = ("", -1), None
            """The row that was asked for last."""
            self._counts: dict[CaptureState, int] = {}
            self._counted_at = -1
            self._removal = Retention(
                self._layout, self._database, self._account, self._quarantine, self._forget)
        except OSError as error:
            os.close(self._lock)
            if isinstance(error, StoreError):
                raise
            raise StoreError(f"{folder}: {error}") from error

    @property
    def epoch(self) -> str:
        """Name of this store, as long as it lives."""
        return self._epoch

    def close(self) -> None:
        """Save the store's clock, close the database and release the lock."""
        with suppress(StoreError, DamagedDatabaseError):
            self._database.set_meta("clock", self._account.save())
        self._database.close()
        os.close(self._lock)

    def free_bytes(self) -> int:
        """Give the room that is left on the disk."""
        try:
            return shutil.disk_usage(self._layout.frames).free
        except OSError as error:
            raise store_error(self._layout.frames, error) from error

    def prepare_frame(
        self, frame: Packet, settings: Settings, settings_hash: str, pressed_by: str = ""
    ) -> PendingWrite:
        """Give what is to be written of a `Frame`."""
        message = frame.message
        if not isinstance(message, Frame):
            raise TypeError(f"a Frame is accepted, found {message.kind}")
        capture_id = message.capture_id
        self._removal.finish(capture_id)
        clock = self._account.save()
        metadata = FrameMetadata(
            accepted_at=stamp(self._account.wall()), clock=clock,
            settings=settings.model_dump_json(), settings_hash=settings_hash,
            pressed_by=pressed_by)
        return PendingWrite(capture_id, self._layout.frame(capture_id), metadata, frame)

    def accept(self, frames: Sequence[WriteResult], state: CaptureState) -> None:
        """Keep frames that were written, all or none; `state` is their captures' from now on."""
        fresh = {one.pending.capture_id: _frame_record(one) for one in frames}
        with self._database.transaction() as database:
            database.executemany(
                "INSERT INTO captures (capture_id, state, settings_hash, frame_sha256,"
                " accepted_at, pressed_by) VALUES (?, ?, ?, ?, ?, ?)",
                [(capture_id, state, kept.metadata.settings_hash, kept.checksum,
                  kept.metadata.accepted_at, kept.metadata.pressed_by)
                 for capture_id, kept in fresh.items()])
        self._fresh.add(fresh.values())
        failpoint("hub.frame.stored")

    def find(self, capture_id: str) -> CaptureRow | None:
        """Give a capture's row."""
        # Asked again and again of what comes next, between two changes.
        asked = capture_id, self._database.changes
        if self._found[0] != asked:
            row = self._database.one(
                "SELECT * FROM captures WHERE capture_id = ? AND state != ?",
                capture_id, CaptureState.REMOVED)
            self._found = asked, None if row is None else CaptureRow(
                CaptureState(row["state"]), row["settings_hash"], row["frame_sha256"],
                row["attempts"], row["accepted_at"], row["pressed_by"])
        return self._found[1]

    def unfinished(self) -> list[str]:
        """Give the ids of what was accepted and has no outcome, oldest first."""
        return self._database.ids(
            "SELECT capture_id FROM captures WHERE state = ? ORDER BY position",
            CaptureState.ACCEPTED)

    def start_attempt(self, capture_id: str) -> int:
        """Count an attempt before it is made and give its number, from 1."""
        # Not synced: a power cut may cost this count, and the frame is tried once more.
        rows = self._database.all(
            "UPDATE captures SET attempts = attempts + 1 WHERE capture_id = ? RETURNING attempts",
            capture_id, synced=False)
        if not rows:
            raise StoreError(f"capture {capture_id} is not in the store")
        failpoint("hub.attempt.counted")
        return int(rows[0]["attempts"])

    def undo_attempt(self, capture_id: str) -> None:
        """Count an attempt no more that was not made to its end."""
        self._database.all(
            "UPDATE captures SET attempts = max(attempts - 1, 0) WHERE capture_id = ?", capture_id)

    def frame(self, capture_id: str) -> FrameRecord:
        """Give the frame back; CorruptFileError where it is damaged, which quarantines it."""
        stored = self.find(capture_id)
        if stored is None:
            raise StoreError(f"capture {capture_id} is not in the store")
        path = self._layout.frame(capture_id)
        try:
            # Most go to a worker soon after they are safe; a second time the file is read.
            fresh = self._fresh.pop(capture_id)
            if fresh and fresh.checksum == stored.frame_sha256:
                return fresh
            return read_frame(path, stored.frame_sha256)
        except CorruptFileError as error:
            self._quarantine.take(path, str(error), capture_id)
            raise

    def prepare_face(self, result: Packet) -> PendingWrite:
        """Give what is to be written of a `Result`; StoreError where it is of no use."""
        message = result.message
        if not isinstance(message, Result):
            raise TypeError(f"a Result finishes a capture, found {message.kind}")
        stored = self.find(message.capture_id)
        if stored is None or stored.state is not CaptureState.ACCEPTED:
            raise StoreError(f"capture {message.capture_id} waits for no face")
        metadata = FaceMetadata(
            accepted_at=stored.accepted_at, finished_at=stamp(self._account.wall()),
            clock=self._account.save())
        return PendingWrite(message.capture_id,
                     self._layout.face(message.capture_id, message.settings_hash), metadata, result)

    def finish(self, faces: Sequence[WriteResult], state: CaptureState) -> None:
        """Keep faces that were written as outcomes, in order, all or none; as `accept`."""
        fresh = {one.pending.capture_id: _face_record(one) for one in faces}
        with self._database.transaction() as database:
            for capture_id, kept in fresh.items():
                self._conclude(database, capture_id, state, kept.metadata.finished_at,
                               face_sha256=kept.checksum)
        self._fresh_faces = fresh
        self._unread.update(fresh)
        failpoint("hub.outcome.stored")

    def fail(self, capture_id: str, state: CaptureState, error: str, message: str) -> None:
        """Keep a failure as the outcome of a capture, which is in `state` from now on."""
        with self._database.transaction() as database:
            self._conclude(database, capture_id, state, stamp(self._account.wall()),
                           error=error, message=message)
        failpoint("hub.outcome.stored")

    def reopen(self, capture_id: str, state: CaptureState, *, attempts_left: bool) -> None:
        """Withdraw an outcome: the capture goes on from `state`, its number is used up."""
        # One that is damaged as soon as it is written has used up its attempt.
        attempts_left = attempts_left and capture_id not in self._unread
        self._unread.discard(capture_id)
        with self._database.transaction() as database:
            database.execute("DELETE FROM outcomes WHERE capture_id = ?", (capture_id,))
            database.execute(
                "UPDATE captures SET state = ?, attempts = iif(?, 0, attempts)"
                " WHERE capture_id = ?", (state, attempts_left, capture_id))

    def outcome(self, capture_id: str) -> Packet | None:
        """Give the outcome as `FaceDone` or `CaptureFailed`."""
        return self._outcome("capture_id = ?", capture_id)

    def outcome_after(self, sequence: int) -> Packet | None:
        """Give the first outcome after a sequence number."""
        return self._outcome("sequence > ? ORDER BY sequence", sequence)

    def last_sequence(self) -> int:
        """Give the number of the last outcome there was, kept or not; 0 where there was none."""
        row = self._database.one("SELECT seq FROM sqlite_sequence WHERE name = 'outcomes'")
        return int(row["seq"]) if row else 0

    def sequence_before_last(self, count: int) -> int:
        """Give the number after which the last `count` outcomes come that are kept."""
        row = self._database.one(
            "SELECT coalesce(min(sequence) - 1, ?) AS number FROM"
            " (SELECT sequence FROM outcomes ORDER BY sequence DESC LIMIT ?)",
            self.last_sequence(), count)
        return int(row["number"]) if row else 0

    def sequence_before_time(self, since: datetime) -> int:
        """Give the number after which the outcomes come that are as old as `since`, or newer."""
        row = self._database.one(
            "SELECT coalesce(min(sequence) - 1, ?) AS number FROM outcomes WHERE finished_at >= ?",
            self.last_sequence(), stamp(since))
        return int(row["number"]) if row else 0

    def dead_letters(self, after: int, most: int) -> list[DeadLetter]:
        """List what was given up, by sequence number."""
        return [DeadLetter(
            sequence=row["sequence"], capture_id=row["capture_id"], error=row["error"],
            message=row["message"][:_SHOWN], attempts=row["attempts"],
            accepted_at=row["accepted_at"], finished_at=row["finished_at"],
        ) for row in self._database.rows(
            "SELECT * FROM outcomes JOIN captures USING (capture_id) WHERE dead AND sequence > ?"
            " ORDER BY sequence LIMIT ?", after, most)]

    def counts(self) -> dict[CaptureState, int]:
        """Give the number of captures that are kept in each state."""
        # Asked at every heartbeat: counting a million rows anew would keep an idle hub busy.
        if self._counted_at != self._database.changes:
            self._counted_at = self._database.changes
            self._counts = {
                CaptureState(row["state"]): row["count"] for row in self._database.rows(
                    "SELECT state, count(*) AS count FROM captures WHERE state != ?"
                    " GROUP BY state", CaptureState.REMOVED)}
        return dict(self._counts)

    def expired(self, retention_s: float, most: int) -> list[str]:
        """Give ids of what was finished longer ago than the retention, oldest first."""
        return self._removal.expired(retention_s, most)

    def accepted_before(self, moment: datetime | None, most: int) -> list[str]:
        """Give ids of what was accepted before a time, oldest first; all where it is None."""
        return self._removal.accepted_before(moment, most)

    def remove(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        """Mark captures, whose outcomes are withdrawn, as gone; `erase` or `sweep` does the rest.

        Parameters
        ----------
        state : REMOVED, which nothing else here sees
        """
        self._removal.remove(capture_ids, state)

    def erase(self, capture_ids: Sequence[str]) -> None:
        """Erase what was removed: frames, faces, reports and rows, so that nothing can be read.

        Where a file resists, StoreError: `sweep` tries again.
        """
        self._removal.erase(capture_ids)

    def sweep(self, retention_s: float | None) -> None:
        """Finish what `remove` began; remove what is in quarantine for longer than that."""
        self._removal.sweep(retention_s)

    def clear_quarantine(self) -> None:
        """Remove all that is in quarantine."""
        self._removal.clear_quarantine()

    def _forget(self, capture_ids: Sequence[str]) -> None:
        for capture_id in capture_ids:
            self._fresh.pop(capture_id)
            self._fresh_faces.pop(capture_id, None)
        self._unread.difference_update(capture_ids)

    def _conclude(
        self, database: Connection, capture_id: str, state: CaptureState, now: str, *,
        face_sha256: str | None = None, error: str | None = None, message: str | None = None,
    ) -> None:
        database.execute("UPDATE captures SET state = ? WHERE capture_id = ?", (state, capture_id))
        database.execute(
            "INSERT INTO outcomes (capture_id, face_sha256, error, message, dead,"
            " finished_at, finished_age_s) VALUES (?, ?, ?, ?, ?, ?, ?)",
            (capture_id, face_sha256, error, message, state is CaptureState.DEAD, now,
             self._account.now()))

    def _outcome(self, which: str, *values: str | int) -> Packet | None:
        row = self._database.one(
            f"SELECT outcomes.*, settings_hash FROM outcomes JOIN captures USING (capture_id)"  # noqa: S608
            f" WHERE {which} LIMIT 1", *values)
        if row is None:
            return None
        capture_id = row["capture_id"]
        common = {"epoch": self._epoch, "sequence": row["sequence"], "capture_id": capture_id}
        if row["face_sha256"] is None:
            return Packet(CaptureFailed(
                **common, error=row["error"], message=row["message"], dead=bool(row["dead"])))
        path = self._layout.face(capture_id, row["settings_hash"])
        try:
            fresh = self._fresh_faces.pop(capture_id, None)
            if fresh is None or fresh.checksum != row["face_sha256"]:
                fresh = read_face(path, row["face_sha256"])
                self._unread.discard(capture_id)
        except CorruptFileError as error:
            self._quarantine.take(path, str(error), capture_id)
            raise DamagedFaceError(capture_id, str(error)) from error
        return Packet(FaceDone(**common, face=fresh.message.face), fresh.arrays)


def _frame_record(written: WriteResult) -> FrameRecord:
    packet, metadata = written.pending.packet, written.pending.metadata
    if not isinstance(packet.message, Frame) or not isinstance(metadata, FrameMetadata):
        raise TypeError(f"a frame is accepted, found {packet.message.kind}")
    return FrameRecord(packet.message, packet.arrays, metadata, written.checksum)


def _face_record(written: WriteResult) -> FaceRecord:
    packet, metadata = written.pending.packet, written.pending.metadata
    if not isinstance(packet.message, Result) or not isinstance(metadata, FaceMetadata):
        raise TypeError(f"a face finishes a capture, found {packet.message.kind}")
    return FaceRecord(packet.message, packet.arrays, metadata, written.checksum)
