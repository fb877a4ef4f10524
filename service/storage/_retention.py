"""Removal from the data folder: rows are marked, then files removed, then the rows.

A hub that is killed in between leaves nothing that can be read, and the next one goes on.
"""

from collections.abc import Callable, Sequence
from datetime import datetime

from denseface.service.protocol.states import CaptureState
from denseface.service.runtime.files import sync_folder
from denseface.service.storage._database import Database
from denseface.service.storage._disk_reserve import DiskReserve
from denseface.service.storage._folder_layout import FolderLayout
from denseface.service.storage._quarantine import Quarantine
from denseface.service.storage._record_file import wrap_os_errors
from denseface.service.storage._store_clock import StoreClock, format_timestamp


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
        self._quarantine = quarantine
        self._forget = forget
        self._reserve = DiskReserve(layout.disk_reserve)
        self._reserve.allocate()

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

    def accepted_before(self, moment: datetime | None, limit: int) -> list[str]:
        """Give ids of what was accepted before a time, oldest first; all where it is None."""
        until = format_timestamp(moment) if moment else "a"  # sorts after any timestamp
        return self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state != ? AND accepted_at < ?"
            " ORDER BY position LIMIT ?", CaptureState.REMOVED, until, limit)

    def remove(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        """Withdraw captures and their outcomes; `erase` or `sweep` does the rest.

        Parameters
        ----------
        state : REMOVED, which no other method sees
        """
        self._reserve.spend_on(lambda: self._mark(capture_ids, state))

    def erase(self, capture_ids: Sequence[str]) -> None:
        """Erase frames, faces, reports and rows of what was removed, so that none can be read.

        Raises StoreError where a file cannot be erased: `sweep` tries again.
        """
        self._reserve.spend_on(lambda: self._erase(capture_ids))

    def sweep(self, retention_s: float | None) -> None:
        """Finish what `remove` began; remove what is in quarantine for longer than that."""
        self._reserve.spend_on(lambda: self._erase(self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state = ?", CaptureState.REMOVED)))
        self._database.set_meta("clock", self._clock.save())
        if retention_s is not None and self._clock.trusted(retention_s):
            with wrap_os_errors(self._layout.quarantine):
                self._quarantine.remove_older(retention_s)

    def finish_erasing(self, capture_id: str) -> None:
        """Finish what `remove` began of a capture whose id is used again, if anything."""
        self._erase(self._database.select_ids(
            "SELECT capture_id FROM captures WHERE state = ? AND capture_id = ?",
            CaptureState.REMOVED, capture_id))

    def clear_quarantine(self) -> None:
        """Remove all that is in quarantine."""
        with wrap_os_errors(self._layout.quarantine):
            self._quarantine.clear()

    def _mark(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        with self._database.transaction() as connection:
            for capture_id in capture_ids:
                connection.execute("DELETE FROM outcomes WHERE capture_id = ?", (capture_id,))
                connection.execute(
                    "UPDATE captures SET state = ? WHERE capture_id = ?", (state, capture_id))

    def _erase(self, capture_ids: Sequence[str]) -> None:
        """Remove files, then rows: while a file is left, so is a row that says REMOVED."""
        if not capture_ids:
            return
        self._forget(capture_ids)
        for capture_id in capture_ids:
            row = self._database.select_one(
                "SELECT settings_hash FROM captures WHERE capture_id = ?", capture_id)
            paths = [self._layout.frame(capture_id)]
            if row:
                paths.append(self._layout.face(capture_id, row["settings_hash"]))
            for path in paths:
                with wrap_os_errors(path):
                    path.unlink(missing_ok=True)
        for folder in (self._layout.frames, self._layout.faces):
            with wrap_os_errors(folder):
                sync_folder(folder)
        with wrap_os_errors(self._layout.quarantine):
            self._quarantine.remove(capture_ids)
        with self._database.transaction() as connection:
            connection.executemany(
                "DELETE FROM captures WHERE capture_id = ? AND state = 'removed'",
                [(capture_id,) for capture_id in capture_ids])
        self._database.truncate_log()
