"""The rows of captures and outcomes: how they are found and changed."""

from dataclasses import dataclass
from datetime import datetime
from sqlite3 import Connection, Row
from typing import Self

from pydantic import ValidationError

from denseface.recon.face import Consent
from denseface.service.errors import DamagedDatabaseError, StoreError, first_error
from denseface.service.protocol.message_base import CaptureSummary, DeadLetter
from denseface.service.protocol.states import CaptureState
from denseface.service.runtime.failpoints import failpoint
from denseface.service.storage._database import MAX_ERROR, MAX_MESSAGE, Database
from denseface.service.storage._store_clock import StoreClock, format_timestamp
from denseface.service.storage.records import FaceMetadata, FrameMetadata

_MAX_MESSAGE = 300
"""Characters of an error in a list."""


@dataclass(frozen=True)
class ConsentRow:
    """What was agreed to with a press."""

    consent: Consent
    due_age_s: float | None
    """Age of the store at which the capture goes, seconds; None where no time was promised."""

    @classmethod
    def of(cls, metadata: FrameMetadata | FaceMetadata) -> Self | None:
        """Give what a file says; None where the press came without a consent."""
        return cls(metadata.consent, metadata.due_age_s) if metadata.consent else None

    @classmethod
    def read(cls, row: Row) -> Self | None:
        """Read a row that is joined with `consents`; DamagedDatabaseError where it is malformed."""
        if row["text_version"] is None:
            return None
        try:
            consent = Consent.model_validate({
                "text_version": row["text_version"], "language": row["language"],
                "retention_s": row["retention_s"], "at": row["agreed_at"]})
        except ValidationError as error:
            raise DamagedDatabaseError(f"consent: {' '.join(first_error(error))}") from error
        return cls(consent, row["due_age_s"])

    def insert(self, connection: Connection, capture_id: str) -> None:
        """Add it to a capture that has a row."""
        said = self.consent
        connection.execute(
            "INSERT INTO consents VALUES (?, ?, ?, ?, ?, ?)",
            (capture_id, said.text_version, said.language, said.retention_s, said.at.isoformat(),
             self.due_age_s))


@dataclass(frozen=True)
class CaptureRow:
    """A capture's row."""

    capture_id: str
    state: CaptureState
    settings_hash: str
    frame_sha256: str
    """Checksum of the frame's file: names what a result must have been made of."""
    accepted_at: str
    pressed_by: str = ""
    """Fingerprint of the key that pressed; empty where none was needed."""
    attempts: int = 0
    consent: ConsentRow | None = None
    """For `insert`; what is found comes without."""

    def insert(self, connection: Connection) -> None:
        """Add this row."""
        connection.execute(
            "INSERT INTO captures (capture_id, state, settings_hash, frame_sha256, accepted_at,"
            " pressed_by, attempts) VALUES (:capture_id, :state, :settings_hash, :frame_sha256,"
            " :accepted_at, :pressed_by, :attempts)", vars(self))
        if self.consent:
            self.consent.insert(connection, self.capture_id)


@dataclass(frozen=True)
class NewOutcome:
    """An outcome whose row is missing: a face or an error."""

    state: CaptureState
    finished_at: str
    age_s: float
    """Age of the store at that time, seconds."""
    face_sha256: str | None = None
    error: str | None = None
    message: str | None = None

    def insert(self, connection: Connection, capture_id: str) -> None:
        """Add the outcome of a capture and set its state; raises where it has an outcome."""
        connection.execute(
            "UPDATE captures SET state = ? WHERE capture_id = ?", (self.state, capture_id))
        connection.execute(
            "INSERT INTO outcomes (capture_id, face_sha256, error, message, dead, finished_at,"
            " finished_age_s) VALUES (?, ?, ?, ?, ?, ?, ?)",
            (capture_id, self.face_sha256, self.error and self.error[:MAX_ERROR],
             self.message and self.message[:MAX_MESSAGE],
             self.state is CaptureState.DEAD, self.finished_at, self.age_s))


class CaptureRows:
    """Rows of one database; each change is durable when its method returns."""

    def __init__(self, database: Database, clock: StoreClock) -> None:
        self._database = database
        self._clock = clock
        self._last_find: tuple[tuple[str, int], CaptureRow | None] = ("", -1), None
        """Arguments and result of the last `find`."""
        self._counts: dict[CaptureState, int] = {}
        self._counted_at = -1
        """`change_count` when `_counts` was made."""

    def find(self, capture_id: str) -> CaptureRow | None:
        """Give a capture's row."""
        # Asked several times of the capture that comes next, between two changes.
        asked = capture_id, self._database.change_count
        if self._last_find[0] != asked:
            row = self._database.select_one(
                "SELECT * FROM captures WHERE capture_id = ? AND state != ?",
                capture_id, CaptureState.REMOVED)
            self._last_find = asked, None if row is None else CaptureRow(
                capture_id, CaptureState(row["state"]), row["settings_hash"],
                row["frame_sha256"], row["accepted_at"], row["pressed_by"], row["attempts"])
        return self._last_find[1]

    def consent(self, capture_id: str) -> ConsentRow | None:
        """Give what was agreed to with the press of a capture."""
        row = self._database.select_one(
            "SELECT * FROM consents WHERE capture_id = ?", capture_id)
        return ConsentRow.read(row) if row else None

    def unfinished(self) -> list[str]:
        """Give the ids of what was accepted and has no outcome, oldest first."""
        return self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state = ? ORDER BY position",
            CaptureState.ACCEPTED)

    def start_attempt(self, capture_id: str) -> int:
        """Count an attempt before it is made and give its number, from 1.

        Not synced: a power cut may lose this count, and the frame is tried once more.
        """
        rows = self._database.execute(
            "UPDATE captures SET attempts = attempts + 1 WHERE capture_id = ? RETURNING attempts",
            capture_id, synced=False)
        if not rows:
            raise StoreError(f"capture {capture_id} is not in the store")
        failpoint("hub.attempt.counted")
        return int(rows[0]["attempts"])

    def undo_attempt(self, capture_id: str) -> None:
        """Subtract an attempt that was not made to its end."""
        self._database.execute(
            "UPDATE captures SET attempts = max(attempts - 1, 0) WHERE capture_id = ?", capture_id)

    def fail(self, capture_id: str, state: CaptureState, error: str, message: str) -> None:
        """Add a failure as the outcome of a capture, which is in `state` from now on."""
        with self._database.transaction() as connection:
            NewOutcome(state, self._clock.timestamp(), self._clock.now(), error=error,
                       message=message).insert(connection, capture_id)
        failpoint("hub.outcome.stored")

    def reopen(self, capture_id: str, state: CaptureState, *, reset_attempts: bool) -> None:
        """Withdraw an outcome: the capture goes on from `state`, its number is used up."""
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM outcomes WHERE capture_id = ?", (capture_id,))
            connection.execute(
                "UPDATE captures SET state = ?, attempts = iif(?, 0, attempts)"
                " WHERE capture_id = ?", (state, reset_attempts, capture_id))

    def last_sequence(self) -> int:
        """Give the number of the last outcome, removed or not; 0 where there was none."""
        row = self._database.select_one("SELECT seq FROM sqlite_sequence WHERE name = 'outcomes'")
        return int(row["seq"]) if row else 0

    def sequence_before_last(self, count: int) -> int:
        """Give the number after which the last `count` outcomes come that are kept."""
        row = self._database.select_one(
            "SELECT coalesce(min(sequence) - 1, ?) AS number FROM"
            " (SELECT sequence FROM outcomes ORDER BY sequence DESC LIMIT ?)",
            self.last_sequence(), count)
        return int(row["number"]) if row else 0

    def sequence_before_time(self, since: datetime) -> int:
        """Give the number after which the outcomes come that are as old as `since`, or newer."""
        # By +sequence, SQLite looks up the time instead of reading all outcomes from the oldest on.
        row = self._database.select_one(
            "SELECT coalesce(min(+sequence) - 1, ?) AS number FROM outcomes WHERE finished_at >= ?",
            self.last_sequence(), format_timestamp(since))
        return int(row["number"]) if row else 0

    def last_accepted(self, limit: int) -> list[CaptureSummary]:
        """List the captures that were accepted last, the newest first."""
        rows = self._database.select(
            "SELECT captures.*, sequence, finished_at, error, message, text_version, language,"
            " retention_s, agreed_at, due_age_s FROM captures"
            " LEFT JOIN outcomes USING (capture_id) LEFT JOIN consents USING (capture_id)"
            " WHERE state != ? ORDER BY position DESC LIMIT ?", CaptureState.REMOVED, limit)
        return [CaptureSummary(
            capture_id=row["capture_id"], state=row["state"], accepted_at=row["accepted_at"],
            attempts=row["attempts"], finished_at=row["finished_at"], sequence=row["sequence"],
            error=row["error"], message=row["message"] and row["message"][:_MAX_MESSAGE],
            consent=agreed.consent if (agreed := ConsentRow.read(row)) else None)
            for row in rows]

    def dead_letters(self, after: int, limit: int) -> list[DeadLetter]:
        """List dead letters after a sequence number, in order."""
        return [DeadLetter(
            sequence=row["sequence"], capture_id=row["capture_id"], error=row["error"],
            message=row["message"][:_MAX_MESSAGE], attempts=row["attempts"],
            accepted_at=row["accepted_at"], finished_at=row["finished_at"],
        ) for row in self._database.select(
            "SELECT * FROM outcomes JOIN captures USING (capture_id) WHERE dead AND sequence > ?"
            " ORDER BY sequence LIMIT ?", after, limit)]

    def counts(self) -> dict[CaptureState, int]:
        """Give the number of captures that are kept in each state."""
        # Asked at every heartbeat: counting a million rows anew would keep an idle hub busy.
        if self._counted_at != self._database.change_count:
            self._counted_at = self._database.change_count
            self._counts = {
                CaptureState(row["state"]): row["count"] for row in self._database.select(
                    "SELECT state, count(*) AS count FROM captures WHERE state != ?"
                    " GROUP BY state", CaptureState.REMOVED)}
        return dict(self._counts)
