"""The data folder: frames and faces as files, what became of them in SQLite.

A file is written and synced before its row is, so a row always names a file that is safe.
"""

import gc
import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import structlog

from denseface.recon.face import Consent
from denseface.recon.settings import Settings
from denseface.service.errors import CorruptFileError, DamagedFaceError, StoreError
from denseface.service.protocol.messages import CaptureFailed, FaceDone, Frame, Result
from denseface.service.protocol.payload import FaceHeader
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.closing import Closing
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.files import private_folder
from denseface.service.runtime.folder_lock import check_folder, lock
from denseface.service.storage._capture_rows import (
    CaptureRow,
    CaptureRows,
    ConsentRow,
    NewOutcome,
)
from denseface.service.storage._folder_layout import FolderLayout
from denseface.service.storage._frame_cache import FrameCache
from denseface.service.storage._record_file import wrap_os_errors
from denseface.service.storage._recovery import Progress, recover
from denseface.service.storage._retention import Retention
from denseface.service.storage._store_clock import Clock, SystemClock
from denseface.service.storage.records import (
    FaceMetadata,
    FaceRecord,
    FrameMetadata,
    FrameRecord,
    PendingWrite,
    read_face,
    read_frame,
)
from denseface.service.storage.writer import WriteResult

__all__ = ["FolderStore", "OpeningStore"]


class FolderStore(CaptureRows, Closing):
    """Captures and their outcomes in a folder, repaired where it is damaged.

    A file is written by a `Writer`, between `prepare_frame` and `accept`, `prepare_face` and
    `finish`. Each other call is durable when it returns, or raises StoreError; where the database
    itself is malformed, DamagedDatabaseError.

    Parameters
    ----------
    folder : `frames/`, `faces/`, `quarantine/`, `captures.sqlite3`, `lock`; created where missing
    clock : tells how old things are
    progress : is told how many files are read

    Raises
    ------
    SettingsError
        Where the folder cannot be created or is another user's.
    HubRunningError
        Where another hub has it open.
    StoreError
        Where it cannot be read or written.
    """

    def __init__(
        self, folder: Path, clock: Clock | None = None, progress: Progress | None = None,
    ) -> None:
        with wrap_os_errors(folder):
            self._layout = FolderLayout(private_folder(folder))
        self._frame_cache = FrameCache()
        self._recent_faces: dict[str, FaceRecord] = {}
        """Faces of the last `finish`: they are published next."""
        self._unread_faces: set[str] = set()
        """Captures whose face was published from memory and never read from its file."""
        self._lock = lock(self._layout.lock)
        try:
            database, store_clock, self._quarantine = recover(
                self._layout, clock or SystemClock(), progress or Progress())
            super().__init__(database, store_clock)
            self.epoch = database.meta("epoch") or ""
            """Name of this database; another one where it was rebuilt."""
            self.retention = Retention(
                self._layout, database, store_clock, self._quarantine, self._forget)
            """Finds and removes what is old or withdrawn."""
        except OSError as error:
            os.close(self._lock)
            if isinstance(error, StoreError):
                raise
            raise StoreError(f"{folder}: {error}") from error

    def close(self) -> None:
        """Save the store's clock, close the database and release the lock."""
        with suppress(OSError):  # a full disk, a damaged database
            self._database.set_meta("clock", self._clock.save())
        self._database.close()
        os.close(self._lock)

    def free_bytes(self) -> int:
        """Give the free space of the disk."""
        with wrap_os_errors(self._layout.frames):
            return shutil.disk_usage(self._layout.frames).free

    def prepare_frame(
        self, frame: Packet, settings: Settings, settings_hash: str, pressed_by: str = "",
        consent: Consent | None = None,
    ) -> PendingWrite:
        """Give what is to be written of a `Frame`, and of what came with its press."""
        message = frame.message
        if not isinstance(message, Frame):
            raise TypeError(f"a Frame is accepted, found {message.kind}")
        capture_id = message.capture_id
        self.retention.finish_erasing(capture_id)
        metadata = FrameMetadata(
            accepted_at=self._clock.timestamp(), clock=self._clock.save(),
            settings=settings.model_dump_json(), settings_hash=settings_hash,
            pressed_by=pressed_by, consent=consent,
            due_age_s=(self._clock.now() + consent.retention_s
                       if consent and consent.retention_s else None))
        return PendingWrite(
            capture_id, self._layout.frame(capture_id), self._layout.unnamed_frame(capture_id),
            metadata, frame)

    def accept(self, frames: Sequence[WriteResult], state: CaptureState) -> None:
        """Add rows for frames that were written, all or none; their captures are in `state`.

        With its row a frame is accepted, whether its file can be named now or by the next hub.
        """
        records = [one.record(Frame, FrameMetadata) for one in frames]
        with self._database.transaction() as connection:
            for one in records:
                CaptureRow(
                    one.message.capture_id, state, one.metadata.settings_hash, one.checksum,
                    one.metadata.accepted_at, one.metadata.pressed_by,
                    consent=ConsentRow.of(one.metadata)).insert(connection)
        failpoint("hub.frame.stored")
        for written in frames:
            try:
                written.pending.name()
            except StoreError as error:
                structlog.get_logger("store").warning(
                    "not named yet", capture_id=written.pending.capture_id, reason=str(error))
        self._frame_cache.add(records)

    def refuse(self, frames: Sequence[PendingWrite]) -> None:
        """Make sure that no hub ever finds frames that were not accepted; StoreError if it may."""
        self.retention.settle()
        for one in frames:
            self.retention.discard(one)

    def frame(self, capture_id: str) -> FrameRecord:
        """Give a frame to work on; CorruptFileError where it is damaged, which quarantines it."""
        # Most go to a worker soon after they are accepted; a second time the file is read.
        return self._frame(capture_id, self._frame_cache.pop(capture_id))

    def kept_frame(self, capture_id: str) -> FrameRecord:
        """Give a frame to whoever asks for it; otherwise as `frame`."""
        return self._frame(capture_id, self._frame_cache.get(capture_id))

    def _frame(self, capture_id: str, cached: FrameRecord | None) -> FrameRecord:
        row = self.find(capture_id)
        if row is None:
            raise StoreError(f"capture {capture_id} is not in the store")
        if cached and cached.checksum == row.frame_sha256:
            return cached
        path = self._layout.accepted_frame(capture_id)
        try:
            return read_frame(path, row.frame_sha256)
        except CorruptFileError as error:
            self._quarantine.add(path, str(error), capture_id)
            raise

    def prepare_face(self, result: Packet) -> PendingWrite:
        """Give what is to be written of a `Result`; StoreError where its capture needs no face."""
        message = result.message
        if not isinstance(message, Result):
            raise TypeError(f"a Result finishes a capture, found {message.kind}")
        capture_id = message.capture_id
        row = self.find(capture_id)
        if row is None or row.state is not CaptureState.ACCEPTED:
            raise StoreError(f"capture {capture_id} waits for no face")
        agreed = self.consent(capture_id)
        metadata = FaceMetadata(
            accepted_at=row.accepted_at, finished_at=self._clock.timestamp(),
            clock=self._clock.save(), pressed_by=row.pressed_by,
            consent=agreed.consent if agreed else None,
            due_age_s=agreed.due_age_s if agreed else None)
        names = capture_id, message.settings_hash
        return PendingWrite(
            capture_id, self._layout.face(*names), self._layout.unnamed_face(*names), metadata,
            result)

    def finish(self, faces: Sequence[WriteResult], state: CaptureState) -> None:
        """Add rows for faces that were written, as outcomes, in order, all or none; as `accept`."""
        records = {one.pending.capture_id: one.record(Result, FaceMetadata) for one in faces}
        with self._database.transaction() as connection:
            for capture_id, record in records.items():
                NewOutcome(state, record.metadata.finished_at, self._clock.now(),
                           face_sha256=record.checksum).insert(connection, capture_id)
        self._recent_faces = records
        self._unread_faces.update(records)
        failpoint("hub.outcome.stored")

    def reopen(self, capture_id: str, state: CaptureState, *, reset_attempts: bool) -> None:
        """Withdraw an outcome: the capture goes on from `state`, its number is used up.

        Attempts are not reset where the face was damaged as soon as it was written.
        """
        reset_attempts = reset_attempts and capture_id not in self._unread_faces
        self._unread_faces.discard(capture_id)
        super().reopen(capture_id, state, reset_attempts=reset_attempts)

    def outcome(self, capture_id: str) -> Packet | None:
        """Give a capture's outcome as `FaceDone` or `CaptureFailed`.

        Raises
        ------
        DamagedFaceError
            Where the face is damaged, which quarantines it: `reopen` the capture.
        """
        return self._outcome("capture_id = ?", capture_id)

    def outcome_after(self, sequence: int) -> Packet | None:
        """Give the first outcome after a sequence number; raises as `outcome`."""
        return self._outcome("sequence > ? ORDER BY sequence", sequence)

    def _forget(self, capture_ids: Sequence[str]) -> None:
        for capture_id in capture_ids:
            self._frame_cache.pop(capture_id)
            self._recent_faces.pop(capture_id, None)
        self._unread_faces.difference_update(capture_ids)

    def _outcome(self, condition: str, *values: str | int) -> Packet | None:
        row = self._database.select_one(
            f"SELECT outcomes.*, settings_hash, consents.* FROM outcomes"  # noqa: S608
            f" JOIN captures USING (capture_id) LEFT JOIN consents USING (capture_id)"
            f" WHERE {condition} LIMIT 1", *values)
        if row is None:
            return None
        capture_id = row["capture_id"]
        common = {"epoch": self.epoch, "sequence": row["sequence"], "capture_id": capture_id}
        if row["face_sha256"] is None:
            return Packet(CaptureFailed(
                **common, error=row["error"], message=row["message"], dead=bool(row["dead"])))
        path = self._layout.face(capture_id, row["settings_hash"])
        try:
            record = self._recent_faces.pop(capture_id, None)
            if record is None or record.checksum != row["face_sha256"]:
                record = read_face(path, row["face_sha256"])
                self._unread_faces.discard(capture_id)
        except CorruptFileError as error:
            self._quarantine.add(path, str(error), capture_id)
            raise DamagedFaceError(capture_id, str(error)) from error
        agreed = ConsentRow.read(row)
        return Packet(FaceDone(
            **common, face=_with_consent(record.message.face, agreed)), record.arrays)


def _with_consent(face: FaceHeader, agreed: ConsentRow | None) -> FaceHeader:
    """Give a face whose report says what the hub knows of a consent, whatever a worker said."""
    consent = agreed.consent if agreed else None
    if face.report.consent == consent:
        return face
    report = face.report.model_copy(update={"consent": consent})
    return face.model_copy(update={"report": report})


class OpeningStore(Closing):
    """A `FolderStore` that a thread opens: it may have to read the head of every file.

    Readable when `store` gives it. Raises as `check_folder`; what the store raises, `store` does.
    """

    def __init__(self, folder: Path) -> None:
        check_folder(folder)
        self.progress = Progress()
        self._store: FolderStore | None = None
        self._opening = Background[FolderStore]("store")
        self._opening.start(lambda: self._open(folder))

    def _open(self, folder: Path) -> FolderStore:
        gc.disable()  # a collection of all that is read would stop the other threads for a while
        try:
            return FolderStore(folder, progress=self.progress)
        finally:
            gc.enable()

    def fileno(self) -> int:
        """Give the descriptor to poll for reading."""
        return self._opening.fileno()

    def store(self) -> FolderStore | None:
        """Give the store, None while it is being opened; raises as `FolderStore`."""
        if self._opening.done():
            self._opening.drain()
            self._store = self._opening.result()
        return self._store

    def close(self) -> None:
        """Close the store, or stop opening it."""
        self.progress.cancelled = True
        try:
            if self._opening:
                with suppress(StoreError):
                    self._store = self._opening.result()
            if self._store:
                self._store.close()
        finally:
            self._opening.close()
