"""Opening a data folder, whatever happened to it.

A database that is damaged goes to quarantine and is made again from the files; so is a row whose
file is there without it. A damaged file goes to quarantine, and its capture is made again or ends
as a dead letter that says why. The rest goes on. Nothing that was accepted is lost in silence.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TypeVar

import structlog

from denseface.service.errors import CorruptFileError, DamagedDatabaseError, StoreError
from denseface.service.protocol.states import CaptureEvent, CaptureState, advance
from denseface.service.storage.database import Database
from denseface.service.storage.disk_reserve import DiskReserve
from denseface.service.storage.folder_layout import FolderLayout
from denseface.service.storage.quarantine import Quarantine
from denseface.service.storage.records import FaceRecord, FrameRecord, read_face, read_frame
from denseface.service.storage.store_clock import Clock, StoreClock, stamp

__all__ = ["recover"]

_KeptT = TypeVar("_KeptT", FrameRecord, FaceRecord)

_SHOWN = 5
_JUMP = 1000
"""Numbers left out after a kill: rows may be lost whose outcomes were published already."""

_NO_SETTINGS, _NO_CHECKSUM = "0", "0" * 64
"""Of a capture whose frame cannot be read, for which there is neither."""


def recover(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    """Open what there is, mend it, sweep what is half-written, report what is unknown.

    Raises
    ------
    StoreError, OSError
        Where the folder cannot be read or written.
    """
    for path in layout.half_written():
        path.unlink()
    database, account, quarantine = _open(layout, clock)
    try:
        ballast = DiskReserve(layout.ballast)
        if database.left_open:
            ballast.overboard(lambda: database.jump(_JUMP))
        ballast.overboard(_Adoption(layout, database, account, quarantine).run)
        if unknown := [path.name for path in islice(layout.unknown(), _SHOWN)]:
            _log().warning("unknown files, left alone", folder=str(layout.root), files=unknown)
    except BaseException:
        database.close()
        raise
    return database, account, quarantine


def _open(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    try:
        return _opened(layout, clock)
    except DamagedDatabaseError as error:
        quarantine = Quarantine(layout.quarantine, _account(layout, clock))
        for path in layout.database_files():
            if path.exists():
                quarantine.take(path, str(error))
        _log().warning("the database is made again from the files", reason=str(error))
        return _opened(layout, clock)


def _opened(layout: FolderLayout, clock: Clock) -> tuple[Database, StoreClock, Quarantine]:
    database = Database(layout.database)
    try:
        saved = database.meta("clock")
        account = StoreClock(clock, saved) if saved else _account(layout, clock)
    except ValueError as error:
        database.close()
        raise DamagedDatabaseError(f"{layout.database.name}: {error}") from error
    return database, account, Quarantine(layout.quarantine, account)


def _account(layout: FolderLayout, clock: Clock) -> StoreClock:
    """Go on with the newest account that a frame holds, or a face where there are no frames."""
    accounts: list[StoreClock] = []
    for names, read in ((layout.all_frames(), read_frame), (layout.all_faces(), read_face)):
        for _, path in () if accounts else names:
            with suppress(StoreError):
                accounts.append(StoreClock(clock, read(path).metadata.clock))
    return max(accounts, key=lambda account: account.now(), default=StoreClock(clock, None))


@dataclass(frozen=True)
class _Capture:
    """A row that is missing."""

    accepted_at: str
    settings_hash: str
    frame_sha256: str
    pressed_by: str = ""


@dataclass(frozen=True)
class _Outcome:
    """A row that is missing."""

    finished_at: str
    age_s: float
    state: CaptureState
    face_sha256: str | None = None
    error: str | None = None
    message: str | None = None


class _Adoption:
    """Gives every file its row."""

    def __init__(
        self, layout: FolderLayout, database: Database, account: StoreClock, quarantine: Quarantine
    ) -> None:
        self._layout = layout
        self._database = database
        self._account = account
        self._quarantine = quarantine
        self._known = {row["capture_id"]: row for row in database.rows("SELECT * FROM captures")}
        self._concluded = {
            row["capture_id"] for row in database.rows("SELECT capture_id FROM outcomes")}
        self._captures: dict[str, _Capture] = {}
        self._outcomes: dict[str, _Outcome] = {}
        self._damaged: dict[str, str] = {}

    def run(self) -> None:
        for capture_id, path in self._layout.all_frames():
            if capture_id not in self._known:
                self._frame(capture_id, path)
        for capture_id, path in self._layout.all_faces():
            row = self._known.get(capture_id)
            if capture_id not in self._concluded and (
                    row is None or row["state"] == CaptureState.ACCEPTED):
                self._face(capture_id, path)
        for capture_id, reason in self._damaged.items():
            if capture_id not in self._captures and capture_id not in self._known:
                self._give_up(capture_id, reason)
        if self._captures or self._outcomes:
            self._write()

    def _frame(self, capture_id: str, path: Path) -> None:
        if kept := self._read(capture_id, path, read_frame):
            self._captures[capture_id] = _Capture(
                kept.metadata.accepted_at, kept.metadata.settings_hash, kept.checksum,
                kept.metadata.pressed_by)

    def _face(self, capture_id: str, path: Path) -> None:
        kept = self._read(capture_id, path, read_face)
        if kept is None:
            return
        made_of = kept.message.settings_hash, kept.message.frame_sha256
        row = self._known.get(capture_id)
        capture = self._captures.get(capture_id)
        if row:
            expected = row["settings_hash"], row["frame_sha256"]
        elif capture:
            expected = capture.settings_hash, capture.frame_sha256
        else:
            expected = made_of
            self._captures[capture_id] = _Capture(kept.metadata.accepted_at, *made_of)
        if made_of != expected:
            self._quarantine.take(path, "a face of another frame or settings", capture_id)
            return
        self._outcomes[capture_id] = _Outcome(
            kept.metadata.finished_at, StoreClock.seconds_of(kept.metadata.clock),
            advance(CaptureState.SAVING_FACE, CaptureEvent.FACE_SAVED), face_sha256=kept.checksum)

    def _read(
        self, capture_id: str, path: Path, read: Callable[[Path], _KeptT]
    ) -> _KeptT | None:
        try:
            kept = read(path)
        except CorruptFileError as error:
            self._quarantine.take(path, str(error), capture_id)
            self._damaged.setdefault(capture_id, str(error))
            return None
        except StoreError as error:
            _log().warning("left alone", file=path.name, reason=str(error))
            return None
        if kept.message.capture_id != capture_id:
            reason = f"{path}: is of capture {kept.message.capture_id}"
            self._quarantine.take(path, reason, kept.message.capture_id)
            return None
        return kept

    def _give_up(self, capture_id: str, reason: str) -> None:
        now = stamp(self._account.wall())
        self._captures[capture_id] = _Capture(now, _NO_SETTINGS, _NO_CHECKSUM)
        self._outcomes[capture_id] = _Outcome(
            now, self._account.now(), advance(CaptureState.ACCEPTED, CaptureEvent.EXHAUSTED),
            error="CorruptFileError", message=reason)

    def _write(self) -> None:
        accepted = advance(CaptureState.SAVING_FRAME, CaptureEvent.FRAME_SAVED)
        with self._database.transaction() as database:
            for capture_id, one in sorted(
                    self._captures.items(), key=lambda item: item[1].accepted_at):
                database.execute(
                    "INSERT INTO captures (capture_id, state, settings_hash, frame_sha256,"
                    " accepted_at, pressed_by) VALUES (?, ?, ?, ?, ?, ?)",
                    (capture_id, accepted, one.settings_hash, one.frame_sha256, one.accepted_at,
                     one.pressed_by))
            for capture_id, end in sorted(
                    self._outcomes.items(), key=lambda item: item[1].finished_at):
                database.execute(
                    "INSERT INTO outcomes (capture_id, face_sha256, error, message, dead,"
                    " finished_at, finished_age_s) VALUES (?, ?, ?, ?, ?, ?, ?)",
                    (capture_id, end.face_sha256, end.error, end.message,
                     end.state is CaptureState.DEAD, end.finished_at, end.age_s))
                database.execute("UPDATE captures SET state = ? WHERE capture_id = ?",
                                 (end.state, capture_id))
        _log().warning("files without a row taken in", captures=sorted(self._captures)[:_SHOWN],
                       number=len(self._captures), outcomes=len(self._outcomes))


def _log() -> structlog.stdlib.BoundLogger:
    log: structlog.stdlib.BoundLogger = structlog.get_logger("store")
    return log
