"""Opens a data folder and repairs it.

A database that is damaged goes to quarantine and is rebuilt from the files; a file without a row
gets one. A damaged file goes to quarantine, and its capture is computed again or becomes a dead
letter that says why. Nothing that was accepted is lost silently.
"""

from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TypeVar

import structlog

from denseface.service.errors import CorruptFileError, DamagedDatabaseError, StoreError
from denseface.service.protocol.states import CaptureEvent, CaptureState, advance
from denseface.service.storage._capture_rows import CaptureRow, NewOutcome
from denseface.service.storage._database import Database
from denseface.service.storage._disk_reserve import DiskReserve
from denseface.service.storage._folder_layout import FolderLayout
from denseface.service.storage._quarantine import Quarantine
from denseface.service.storage._store_clock import Clock, StoreClock
from denseface.service.storage.records import FaceRecord, FrameRecord, read_face, read_frame

_RecordT = TypeVar("_RecordT", FrameRecord, FaceRecord)

_SHOWN = 5
"""Names in a log line."""
_SKIPPED_NUMBERS = 1000
"""Sequence numbers left out after a kill: outcomes whose rows are lost may be published already."""

_ACCEPTED = advance(CaptureState.SAVING_FRAME, CaptureEvent.FRAME_SAVED)
"""State of a capture whose row is missing."""
_NO_SETTINGS, _NO_CHECKSUM = "0", "0" * 64
"""In the row of a capture whose frame cannot be read."""


def recover(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    """Open and repair a data folder, remove half-written files, log unknown ones.

    Raises StoreError or OSError where the folder cannot be read or written.
    """
    for path in layout.temporary_files():
        path.unlink()
    database, store_clock, quarantine = _open(layout, clock)
    try:
        reserve = DiskReserve(layout.disk_reserve)
        if database.left_open:
            reserve.spend_on(lambda: database.skip_sequence_numbers(_SKIPPED_NUMBERS))
        reserve.spend_on(_MissingRows(layout, database, store_clock, quarantine).add)
        if unknown := [path.name for path in islice(layout.unknown_files(), _SHOWN)]:
            structlog.get_logger("store").warning(
                "unknown files, left alone", folder=str(layout.root), files=unknown)
    except BaseException:
        database.close()
        raise
    return database, store_clock, quarantine


def _open(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    try:
        return _open_database(layout, clock)
    except DamagedDatabaseError as error:
        quarantine = Quarantine(layout.quarantine, _newest_clock(layout, clock))
        for path in layout.database_files():
            if path.exists():
                quarantine.add(path, str(error))
        structlog.get_logger("store").warning(
            "the database is made again from the files", reason=str(error))
        return _open_database(layout, clock)


def _open_database(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    database = Database(layout.database)
    try:
        saved = database.meta("clock")
        store_clock = StoreClock(clock, saved) if saved else _newest_clock(layout, clock)
    except ValueError as error:
        database.close()
        raise DamagedDatabaseError(f"{layout.database.name}: {error}") from error
    return database, store_clock, Quarantine(layout.quarantine, store_clock)


def _newest_clock(layout: FolderLayout, clock: Clock) -> StoreClock:
    """Give the newest clock of the frames' files, or of the faces' where there are no frames."""
    clocks: list[StoreClock] = []
    for files, read in ((layout.all_frames(), read_frame), (layout.all_faces(), read_face)):
        for _, path in () if clocks else files:
            with suppress(StoreError):
                clocks.append(StoreClock(clock, read(path).metadata.clock))
    return max(clocks, key=lambda one: one.now(), default=StoreClock(clock, None))


class _MissingRows:
    """Rows of files that have none."""

    def __init__(
        self, layout: FolderLayout, database: Database, clock: StoreClock, quarantine: Quarantine
    ) -> None:
        self._layout = layout
        self._database = database
        self._clock = clock
        self._quarantine = quarantine
        self._rows = {
            row["capture_id"]: row for row in database.select("SELECT * FROM captures")}
        self._finished = set(database.select_ids("SELECT capture_id FROM outcomes"))
        self._captures: dict[str, CaptureRow] = {}
        self._outcomes: dict[str, NewOutcome] = {}
        self._damaged: dict[str, str] = {}
        """Capture id -> what is wrong with one of its files."""

    def add(self) -> None:
        """Read the files without rows and add the rows, all or none."""
        for capture_id, path in self._layout.unnamed_frames():
            self._name_or_remove(capture_id, path)
        for capture_id, path in self._layout.all_frames():
            if capture_id not in self._rows:
                self._read_frame(capture_id, path)
        for capture_id, path in self._layout.all_faces():
            row = self._rows.get(capture_id)
            if capture_id not in self._finished and (
                    row is None or row["state"] == CaptureState.ACCEPTED):
                self._read_face(capture_id, path)
        for capture_id, reason in self._damaged.items():
            if capture_id not in self._captures and capture_id not in self._rows:
                self._give_up(capture_id, reason)
        if self._captures or self._outcomes:
            self._write()

    def _name_or_remove(self, capture_id: str, path: Path) -> None:
        """Name a frame that has a row; one without was not accepted.

        Where the database is new nobody knows, and what is whole counts as accepted.
        """
        accepted = capture_id in self._rows
        if self._database.is_new:
            try:
                read_frame(path)
                accepted = True
            except CorruptFileError as error:
                self._quarantine.add(path, str(error), capture_id)
                return
        if accepted:
            path.replace(self._layout.frame(capture_id))
        else:
            path.unlink()

    def _read_frame(self, capture_id: str, path: Path) -> None:
        if record := self._read(capture_id, path, read_frame):
            metadata = record.metadata
            self._captures[capture_id] = CaptureRow(
                capture_id, _ACCEPTED, metadata.settings_hash, record.checksum,
                metadata.accepted_at, metadata.pressed_by)

    def _read_face(self, capture_id: str, path: Path) -> None:
        record = self._read(capture_id, path, read_face)
        if record is None:
            return
        made_of = record.message.settings_hash, record.message.frame_sha256
        if row := self._rows.get(capture_id):
            expected = row["settings_hash"], row["frame_sha256"]
        elif capture := self._captures.get(capture_id):
            expected = capture.settings_hash, capture.frame_sha256
        else:
            expected = made_of
            self._captures[capture_id] = CaptureRow(
                capture_id, _ACCEPTED, *made_of, record.metadata.accepted_at)
        if made_of != expected:
            self._quarantine.add(path, "a face of another frame or settings", capture_id)
            return
        self._outcomes[capture_id] = NewOutcome(
            advance(CaptureState.SAVING_FACE, CaptureEvent.FACE_SAVED), record.metadata.finished_at,
            StoreClock.age_of(record.metadata.clock), face_sha256=record.checksum)

    def _read(
        self, capture_id: str, path: Path, read: Callable[[Path], _RecordT]
    ) -> _RecordT | None:
        try:
            record = read(path)
        except CorruptFileError as error:
            self._quarantine.add(path, str(error), capture_id)
            self._damaged.setdefault(capture_id, str(error))
            return None
        except StoreError as error:
            structlog.get_logger("store").warning(
                "left alone", file=path.name, reason=str(error))
            return None
        if record.message.capture_id != capture_id:
            reason = f"{path}: is of capture {record.message.capture_id}"
            self._quarantine.add(path, reason, record.message.capture_id)
            return None
        return record

    def _give_up(self, capture_id: str, reason: str) -> None:
        now = self._clock.timestamp()
        self._captures[capture_id] = CaptureRow(
            capture_id, _ACCEPTED, _NO_SETTINGS, _NO_CHECKSUM, now)
        self._outcomes[capture_id] = NewOutcome(
            advance(CaptureState.ACCEPTED, CaptureEvent.EXHAUSTED), now, self._clock.now(),
            error="CorruptFileError", message=reason)

    def _write(self) -> None:
        with self._database.transaction() as connection:
            for capture in sorted(self._captures.values(), key=lambda one: one.accepted_at):
                capture.insert(connection)
            for capture_id, outcome in sorted(
                    self._outcomes.items(), key=lambda item: item[1].finished_at):
                outcome.insert(connection, capture_id)
        structlog.get_logger("store").warning(
            "files without a row indexed", captures=sorted(self._captures)[:_SHOWN],
            number=len(self._captures), outcomes=len(self._outcomes))
