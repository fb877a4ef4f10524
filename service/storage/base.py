"""What the hub needs of whatever keeps its captures."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from denseface.recon.settings import Settings
from denseface.service.protocol.messages import DeadLetter
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.storage.records import FrameRecord, PendingWrite
from denseface.service.storage.writer import WriteResult

__all__ = ["CaptureRow", "Store"]


@dataclass(frozen=True)
class CaptureRow:
    """A capture's row."""

    state: CaptureState
    settings_hash: str
    frame_sha256: str
    """Checksum of the frame's file: names what a result must have been made of."""
    attempts: int
    accepted_at: str
    pressed_by: str = ""
    """Fingerprint of the key that pressed; empty where none was needed."""


class Store(Protocol):
    """Captures and their outcomes.

    A file is written between its draft and its row, by a `service.storage.writer.Writer`. Each
    other call is durable when it returns, or raises StoreError; where the database itself is
    malformed, DamagedDatabaseError.
    """

    @property
    def epoch(self) -> str:
        """Name of this store, as long as it lives."""

    def free_bytes(self) -> int:
        """Give the room that is left on the disk."""

    def frame_draft(
        self, frame: Packet, settings: Settings, settings_hash: str, pressed_by: str = ""
    ) -> PendingWrite:
        """Give what is to be written of a `Frame`."""

    def accept(self, frames: Sequence[WriteResult]) -> None:
        """Keep frames that were written, all or none."""

    def find(self, capture_id: str) -> CaptureRow | None:
        """Give a capture's row."""

    def unfinished(self) -> list[str]:
        """Give the ids of what was accepted and has no outcome, oldest first."""

    def start_attempt(self, capture_id: str) -> int:
        """Count an attempt before it is made and give its number, from 1.

        A power cut alone may undo it, until the next call that is durable.
        """

    def take_back_attempt(self, capture_id: str) -> None:
        """Count an attempt no more that was not made to its end."""

    def frame(self, capture_id: str) -> FrameRecord:
        """Give the frame back; CorruptFileError where it is damaged, which quarantines it."""

    def face_draft(self, result: Packet) -> PendingWrite:
        """Give what is to be written of a `Result`; StoreError where it is of no use."""

    def finish(self, faces: Sequence[WriteResult]) -> None:
        """Keep faces that were written as outcomes, in order, all or none.

        A second outcome of a capture changes nothing.
        """

    def fail(self, capture_id: str, error: str, message: str, *, dead: bool) -> None:
        """Keep a failure as the capture's outcome."""

    def reopen(self, capture_id: str, *, attempts_left: bool) -> None:
        """Withdraw an outcome: the capture is accepted again, its number is used up.

        Parameters
        ----------
        attempts_left : False where the attempts made so far go on counting
        """

    def outcome(self, capture_id: str) -> Packet | None:
        """Give the outcome as `FaceDone` or `CaptureFailed`.

        Raises
        ------
        DamagedFaceError
            Where the face is damaged, which quarantines it: `reopen` the capture.
        """

    def outcome_after(self, sequence: int) -> Packet | None:
        """Give the first outcome after a sequence number; raises as `outcome`."""

    def last_sequence(self) -> int:
        """Give the number of the last outcome there was, kept or not; 0 where there was none."""

    def before_last(self, count: int) -> int:
        """Give the number after which the last `count` outcomes come that are kept."""

    def before_time(self, since: datetime) -> int:
        """Give the number after which the outcomes come that are as old as `since`, or newer."""

    def dead_letters(self, after: int, most: int) -> Sequence[DeadLetter]:
        """List what was given up, by sequence number."""

    def counts(self) -> dict[CaptureState, int]:
        """Give the number of captures that are kept in each state."""

    def expired(self, retention_s: float, most: int) -> list[str]:
        """Give ids of what was finished longer ago than the retention, oldest first."""

    def accepted_before(self, moment: datetime | None, most: int) -> list[str]:
        """Give ids of what was accepted before a time, oldest first; all where it is None."""

    def remove(self, capture_ids: Sequence[str]) -> None:
        """Remove frames, faces, reports and rows, so that nothing of them can be read again.

        Where a file resists, the rows stay as REMOVED, which nothing else here sees: `sweep`
        tries again.
        """

    def sweep(self, retention_s: float | None) -> None:
        """Finish what `remove` began; remove what is in quarantine for longer than that."""

    def clear_quarantine(self) -> None:
        """Remove all that is in quarantine."""
