"""Removal from the data folder: rows are marked, then all is erased that they name.

What is marked cannot be read any more; a hub that is killed then leaves the rest to the next one.
"""

from collections.abc import Callable, Sequence
from datetime import datetime

import structlog

from denseface.service.errors import StoreError
from denseface.service.protocol.states import CaptureState
from denseface.service.runtime.failpoints import failpoint
from denseface.service.storage._database import Database
from denseface.service.storage._disk_reserve import DiskReserve
from denseface.service.storage._erasure import Erased, Eraser, Erasure, PendingErasure
from denseface.service.storage._folder_layout import FolderLayout
from denseface.service.storage._quarantine import Quarantine
from denseface.service.storage._record_file import wrap_os_errors
from denseface.service.storage._store_clock import StoreClock, format_timestamp
from denseface.service.storage.records import PendingWrite


class Retention:
    """Removals of a `FolderStore`; errors are those of its methods.

    Parameters
    ----------
    forget : drops captures from memory
    """

    def __init__(
        self, layout: FolderLayout, database: Database, clock: StoreClock, quarantine: Quarantine,
        forget: Callable[[Sequence[str]], None],
    ) -> None:
        self._layout = layout
        self._database = database
        self._clock = clock
        self._forget = forget
        self._reserve = DiskReserve(layout.disk_reserve)
        self._reserve.allocate()
        self._eraser = Eraser(layout, database, quarantine, self._reserve)
        self._erasing: set[str] = set()
        """Captures of which an erasure is under way, or waits to begin."""
        self._discarded: set[str] = set()
        """Captures that were refused and whose frame could not be removed."""
        self._begun = 0
        """Number of the last erasure."""
        self.log_due = database.left_open
        """The write-ahead log is to be emptied: it may name what was erased.

        Its own length says so to the next hub, so nothing else has to be remembered."""

    def expired(self, retention_s: float, limit: int) -> list[str]:
        """Give ids of what was finished longer ago than the retention, oldest first."""
        if not self._clock.trusted(retention_s):
            return []
        # By the store's clock and by the wall clock both, unless that was set back to before the
        # outcome: a clock that is wrong for a while removes nothing.
        now = self._clock.timestamp()
        return self._database.select_ids(
            "SELECT capture_id FROM outcomes WHERE finished_age_s <= ?"
            " AND (julianday(?) - julianday(finished_at) >= ? OR finished_at > ?)"
            " ORDER BY finished_age_s, sequence LIMIT ?",
            self._clock.now() - retention_s, now, retention_s / 86400, now, limit)

    def promised(self, limit: int) -> list[str]:
        """Give ids of what a consent promised to be gone by now, oldest first; whatever its state.

        The time counts from the press. Both clocks say so, as for `expired`.
        """
        now = self._clock.timestamp()
        return [row["capture_id"] for row in self._database.select(
            "SELECT capture_id, retention_s FROM consents JOIN captures USING (capture_id)"
            " WHERE due_age_s <= ? AND state != ?"
            " AND (julianday(?) - julianday(accepted_at) >= retention_s / 86400"
            " OR accepted_at > ?) ORDER BY due_age_s LIMIT ?",
            self._clock.now(), CaptureState.REMOVED, now, now, limit)
            if self._clock.trusted(row["retention_s"])]

    def accepted_before(self, moment: datetime | None, limit: int) -> list[str]:
        """Give ids of what was accepted before a time, oldest first; all where it is None."""
        until = format_timestamp(moment) if moment else "a"  # sorts after any timestamp
        return self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state != ? AND accepted_at < ?"
            " ORDER BY position LIMIT ?", CaptureState.REMOVED, until, limit)

    def remove(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        """Withdraw captures and their outcomes; an erasure does the rest.

        Not synced: until an erasure begins, a power cut may bring them back.

        Parameters
        ----------
        state : REMOVED, which no other method sees
        """
        self._reserve.spend_on(lambda: self._mark(capture_ids, state))
        failpoint("hub.removal.marked")

    def settle(self) -> None:
        """As `Database.settle`, with the reserve's room where the disk is full."""
        self._reserve.spend_on(self._database.settle)

    def discard(self, pending: PendingWrite) -> None:
        """Remove the file of a frame that was refused; one that cannot be removed is `left_over`.

        The next hub would not read it: it has no row.
        """
        try:
            with wrap_os_errors(pending.unnamed):
                pending.unnamed.unlink(missing_ok=True)
        except StoreError as error:
            self._discarded.add(pending.capture_id)
            structlog.get_logger("store").warning(
                "not removed", capture_id=pending.capture_id, reason=str(error))

    def left_over(self, limit: int) -> list[str]:
        """Give ids of what is withdrawn or was refused, and no erasure of it is under way."""
        found = self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state = ? ORDER BY position LIMIT ?",
            CaptureState.REMOVED, limit + len(self._erasing))
        return [one for one in [*found, *self._discarded] if one not in self._erasing][:limit]

    def is_left(self, capture_id: str | None) -> bool:
        """Whether a capture is withdrawn and not erased, or any is where None."""
        return self._database.select_one(
            "SELECT 1 FROM captures WHERE state = ? AND capture_id = coalesce(?, capture_id)"
            " LIMIT 1", CaptureState.REMOVED, capture_id) is not None

    def without_row(self) -> list[str]:
        """Give ids of the files of captures that have no row; to be called while none is written.

        It lists both folders.
        """
        listing = self._layout.listing()
        found = dict.fromkeys(
            [*listing.frames, *listing.unnamed, *(one for one, _ in listing.faces)])
        return [one for one in found if one not in self._erasing and self._hash_of(one) is None]

    def is_erasing(self, capture_id: str) -> bool:
        """Whether an erasure of this capture is under way: its id cannot be used meanwhile."""
        return capture_id in self._erasing

    def prepare(
        self, capture_ids: Sequence[str] = (), *, retention_s: float | None = None,
        all_quarantined: bool = False,
    ) -> PendingErasure:
        """Give what is to be erased of captures that were removed, or have no row; then `finish`.

        Parameters
        ----------
        retention_s : also what is in quarantine for longer than that
        all_quarantined : also all that is in quarantine
        """
        if retention_s is not None and not self._clock.trusted(retention_s):
            retention_s = None
        self._forget(capture_ids)
        # Twice under way, the second might erase what was pressed again after the first.
        captures = {one: self._hash_of(one) for one in capture_ids if one not in self._erasing}
        self._erasing.update(captures)
        self._begun += 1
        return PendingErasure(Erasure(
            captures, self._begun,
            None if retention_s is None else self._clock.now() - retention_s,
            all_quarantined), self._eraser)

    def finish(self, erased: Erased) -> None:
        """Take what became of an erasure; raises its error.

        StoreError where a file cannot be erased: it is `left_over`.
        """
        self._erasing.difference_update(erased.erasure.captures)
        if not erased.log_emptied:
            self.log_due = True
        elif erased.erasure.number == self._begun:
            self.log_due = False
        if erased.error is not None:
            raise erased.error
        self._discarded.difference_update(erased.erasure.captures)

    def erase(self, capture_ids: Sequence[str]) -> None:
        """Erase what was removed before it returns; raises as `finish`."""
        self.finish(self.prepare(capture_ids).run())

    def finish_erasing(self, capture_id: str) -> None:
        """Finish what `remove` began of a capture whose id is used again, if anything."""
        if capture_id in self._erasing:
            raise StoreError(f"an earlier capture {capture_id} is being removed")
        self._discarded.discard(capture_id)
        if self._hash_of(capture_id, CaptureState.REMOVED) is not None:
            self.erase([capture_id])

    def save_clock(self) -> None:
        """Save the store's clock."""
        self._database.set_meta("clock", self._clock.save())

    def _hash_of(self, capture_id: str, state: CaptureState | None = None) -> str | None:
        row = self._database.select_one(
            "SELECT settings_hash FROM captures WHERE capture_id = ?"
            " AND state = coalesce(?, state)", capture_id, state)
        return row["settings_hash"] if row else None

    def _mark(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        with self._database.transaction(synced=False) as connection:
            connection.executemany("DELETE FROM outcomes WHERE capture_id = ?",
                                   [(one,) for one in capture_ids])
            connection.executemany("UPDATE captures SET state = ? WHERE capture_id = ?",
                                   [(state, one) for one in capture_ids])
