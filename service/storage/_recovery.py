"""Opens a data folder and repairs it.

A database that is damaged goes to quarantine and is rebuilt from the files; a file without a row
gets one. For that the head of each file is read, once, whatever its size: damage behind it is found
when the file is needed. A damaged file goes to quarantine, and its capture is computed again or
becomes a dead letter that says why. Nothing that was accepted is lost silently.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TypeVar

import structlog

from denseface.service.errors import CorruptFileError, DamagedDatabaseError, StoreError
from denseface.service.protocol.states import CaptureEvent, CaptureState, advance
from denseface.service.storage._capture_rows import CaptureRow, ConsentRow, NewOutcome
from denseface.service.storage._database import Database
from denseface.service.storage._disk_reserve import DiskReserve
from denseface.service.storage._folder_layout import FolderLayout, Listing
from denseface.service.storage._quarantine import Quarantine
from denseface.service.storage._store_clock import Clock, StoreClock
from denseface.service.storage.records import (
    FaceHead,
    FaceMetadata,
    FrameHead,
    read_face,
    read_face_head,
    read_frame,
    read_frame_head,
)

_HeadT = TypeVar("_HeadT", FrameHead, FaceHead)

_SHOWN = 5
"""Names in a log line."""
_SKIPPED_NUMBERS = 1000
"""Sequence numbers left out after a kill: outcomes whose rows are lost may be published already."""

_ACCEPTED = advance(CaptureState.SAVING_FRAME, CaptureEvent.FRAME_SAVED)
"""State of a capture whose row is missing."""
_NO_SETTINGS, _NO_CHECKSUM = "0", "0" * 64
"""In the row of a capture whose frame cannot be read."""


@dataclass
class Progress:
    """How far a data folder is read; written by the thread that opens it."""

    files: int = 0
    """To be read as they have no row, or 0 where that is not known yet."""
    read: int = 0
    cancelled: bool = False
    """Set it, and what is being opened ends with a StoreError."""

    def count(self) -> None:
        """Count a file that is read."""
        self.read += 1
        if self.cancelled:
            raise StoreError("stopped while the data folder was being read")


def recover(
    layout: FolderLayout, clock: Clock, progress: Progress
) -> tuple[Database, StoreClock, Quarantine]:
    """Open and repair a data folder, remove half-written files, log unknown ones.

    Raises StoreError or OSError where the folder cannot be read or written.
    """
    listing = layout.listing()
    for path in listing.temporary:
        path.unlink()
    files = _Files(layout, clock, progress)
    database, store_clock = _open(layout, clock, files, listing)
    quarantine = Quarantine(layout.quarantine, store_clock)
    try:
        reserve = DiskReserve(layout.disk_reserve)
        if database.left_open:
            reserve.spend_on(lambda: database.skip_sequence_numbers(_SKIPPED_NUMBERS))
        reserve.spend_on(_MissingRows(database, store_clock, quarantine, files, listing).add)
        if listing.unknown:
            structlog.get_logger("store").warning(
                "not the hub's own, neither counted nor removed", folder=str(layout.root),
                number=len(listing.unknown),
                files=[str(path.relative_to(layout.root))
                       for path in islice(listing.unknown, _SHOWN)])
    except BaseException:
        database.close()
        raise
    return database, store_clock, quarantine


def _open(
    layout: FolderLayout, clock: Clock, files: "_Files", listing: Listing
) -> tuple[Database, StoreClock]:
    try:
        return _open_database(layout, clock, files, listing)
    except DamagedDatabaseError as error:
        quarantine = Quarantine(layout.quarantine, files.newest_clock(listing))
        for path in layout.database_files():
            if path.exists():
                quarantine.add(path, str(error))
        structlog.get_logger("store").warning(
            "the database is made again from the files", reason=str(error))
        return _open_database(layout, clock, files, listing)


def _open_database(
    layout: FolderLayout, clock: Clock, files: "_Files", listing: Listing
) -> tuple[Database, StoreClock]:
    database = Database(layout.database)
    try:
        saved = database.meta("clock")
        return database, StoreClock(clock, saved) if saved else files.newest_clock(listing)
    except ValueError as error:
        database.close()
        raise DamagedDatabaseError(f"{layout.database.name}: {error}") from error
    except BaseException:
        database.close()
        raise


@dataclass(frozen=True)
class _Face:
    """What a face's file says of its capture."""

    made_of: tuple[str, str]
    """Hash of the settings, checksum of the frame."""
    metadata: FaceMetadata
    outcome: NewOutcome


@dataclass
class _Files:
    """The files of frames and faces: each is read once, and what rows need of it is kept."""

    layout: FolderLayout
    clock: Clock
    progress: Progress
    frames: dict[str, CaptureRow] = field(default_factory=dict)
    faces: dict[str, _Face] = field(default_factory=dict)
    """By name of the file."""
    damaged: dict[Path, tuple[str, str]] = field(default_factory=dict)
    """File -> the capture that it is of, by its name or by what it says, and the reason."""
    newest: StoreClock | None = None

    def newest_clock(self, listing: Listing) -> StoreClock:
        """Read all files and give the newest of their clocks; a new one where there are none."""
        self.read(listing.frames, listing.faces)
        return self.newest or StoreClock(self.clock, None)

    def read(self, frames: list[str], faces: list[tuple[str, str]]) -> None:
        """Read those that are not read yet."""
        paths = {capture_id: self.layout.frame(capture_id) for capture_id in frames}
        missing = [(one, path) for one, path in paths.items()
                   if one not in self.frames and path not in self.damaged]
        more = [(one, path) for one, name in faces if name not in self.faces
                and (path := self.layout.faces / name) not in self.damaged]
        self.progress.files += len(missing) + len(more)
        for capture_id, path in missing:
            if head := self._read(capture_id, path, read_frame_head, read_frame):
                self.frames[capture_id] = CaptureRow(
                    capture_id, _ACCEPTED, head.metadata.settings_hash, head.checksum,
                    head.metadata.accepted_at, head.metadata.pressed_by,
                    consent=ConsentRow.of(head.metadata))
        for capture_id, path in more:
            if face := self._read(capture_id, path, read_face_head, read_face):
                self.faces[path.name] = _Face(
                    (face.message.settings_hash, face.message.frame_sha256),
                    face.metadata, NewOutcome(
                        advance(CaptureState.SAVING_FACE, CaptureEvent.FACE_SAVED),
                        face.metadata.finished_at, StoreClock.age_of(face.metadata.clock),
                        face_sha256=face.checksum))

    def _read(
        self, capture_id: str, path: Path, read: Callable[[Path], _HeadT],
        check: Callable[[Path], object],
    ) -> _HeadT | None:
        self.progress.count()
        try:
            head = read(path)
            if head.message.capture_id != capture_id:
                check(path)  # a flipped bit, or a whole file under another's name
                self.damaged[path] = (
                    head.message.capture_id, f"{path}: is of capture {head.message.capture_id}")
                return None
            clock = StoreClock(self.clock, head.metadata.clock)
        except CorruptFileError as error:
            self.damaged[path] = capture_id, _damage(path, check) or str(error)
            return None
        except ValueError as error:
            self.damaged[path] = capture_id, f"{path}: {error}"
            return None
        except StoreError as error:
            structlog.get_logger("store").warning(
                "left alone", file=path.name, reason=str(error))
            return None
        if self.newest is None or clock.now() > self.newest.now():
            self.newest = clock
        return head


class _MissingRows:
    """Rows of files that have none."""

    def __init__(
        self, database: Database, clock: StoreClock, quarantine: Quarantine, files: _Files,
        listing: Listing,
    ) -> None:
        self._database = database
        self._clock = clock
        self._quarantine = quarantine
        self._files = files
        self._known = known = set(database.select_ids("SELECT capture_id FROM captures"))
        self._unfinished = {row["capture_id"]: (row["settings_hash"], row["frame_sha256"])
                            for row in database.select(
                                "SELECT capture_id, settings_hash, frame_sha256 FROM captures"
                                " WHERE state = ?", CaptureState.ACCEPTED)}
        self._unnamed = [*listing.unnamed]
        self._frames = [one for one in listing.frames if one not in known]
        self._faces = [(one, name) for one, name in listing.faces
                       if one not in known or one in self._unfinished]
        self._captures: dict[str, CaptureRow] = {}
        self._outcomes: dict[str, NewOutcome] = {}

    def add(self) -> None:
        """Read the files without rows and add the rows, all or none."""
        while self._unnamed:
            self._name_or_remove(self._unnamed[-1])
            self._unnamed.pop()
        self._files.read(self._frames, self._faces)
        self._captures = {one: self._files.frames[one] for one in self._frames
                          if one in self._files.frames}
        self._outcomes = {}
        for capture_id, name in self._faces:
            if face := self._files.faces.get(name):
                self._add_face(capture_id, self._files.layout.faces / name, face)
        for path, (capture_id, reason) in self._files.damaged.items():
            self._quarantine.add(path, reason, capture_id)
        for path, (capture_id, reason) in self._files.damaged.items():
            mine = path.name.partition(".")[0] == capture_id
            if mine and capture_id not in self._captures and capture_id not in self._known:
                self._give_up(capture_id, reason)
        if self._captures or self._outcomes:
            self._write()

    def _name_or_remove(self, capture_id: str) -> None:
        """Name a frame that has a row; one without was not accepted.

        Where the database is new nobody knows, and what is whole counts as accepted.
        """
        path = self._files.layout.unnamed_frame(capture_id)
        accepted = capture_id in self._known
        if self._database.is_new:
            if reason := _damage(path, read_frame):
                self._quarantine.add(path, reason, capture_id)
                return
            accepted = True
        if accepted:
            path.replace(self._files.layout.frame(capture_id))
            self._files.frames.pop(capture_id, None)
            self._frames += () if capture_id in self._known else [capture_id]
        else:
            path.unlink()

    def _add_face(self, capture_id: str, path: Path, face: _Face) -> None:
        expected = self._unfinished.get(capture_id)
        if expected is None:
            if capture_id not in self._captures:
                self._captures[capture_id] = CaptureRow(
                    capture_id, _ACCEPTED, *face.made_of, face.metadata.accepted_at,
                    face.metadata.pressed_by, consent=ConsentRow.of(face.metadata))
            capture = self._captures[capture_id]
            expected = capture.settings_hash, capture.frame_sha256
        if face.made_of == expected:
            self._outcomes[capture_id] = face.outcome
        elif reason := _damage(path, read_face):
            self._files.damaged[path] = capture_id, reason
        elif capture_id not in self._unfinished and (reason := _damage(
                frame := self._files.layout.frame(capture_id), read_frame)):
            self._files.damaged[frame] = capture_id, reason
            del self._captures[capture_id]
            self._add_face(capture_id, path, face)
        else:
            self._quarantine.add(path, "a face of another frame or settings", capture_id)

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


def _damage(path: Path, read: Callable[[Path], object]) -> str:
    """Read all of a file and give what is wrong with it, "" if nothing is."""
    try:
        read(path)
    except CorruptFileError as error:
        return str(error)
    return ""
