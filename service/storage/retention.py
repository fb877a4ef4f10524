"""What leaves the data folder: rows are marked, then files go, then the rows.

So a hub that is killed in the midst leaves nothing that can be read, and the next one goes on.
"""

from collections.abc import Callable, Sequence
from datetime import datetime

from denseface.service.protocol.states import CaptureState
from denseface.service.runtime.files import sync_folder
from denseface.service.storage.database import Database
from denseface.service.storage.disk_reserve import DiskReserve
from denseface.service.storage.folder_layout import FolderLayout
from denseface.service.storage.quarantine import Quarantine
from denseface.service.storage.record_file import naming
from denseface.service.storage.store_clock import StoreClock, stamp

__all__ = ["Retention"]


class Retention:
    """Retention and purges of a `FolderStore`, whose methods of the same names say more.

    Parameters
    ----------
    forget : drops captures from memory
    """

    def __init__(
        self, layout: FolderLayout, database: Database, account: StoreClock, quarantine: Quarantine,
        forget: Callable[[Sequence[str]], None],
    ) -> None:
        self._layout = layout
        self._database = database
        self._account = account
        self._quarantine = quarantine
        self._forget = forget
        self._ballast = DiskReserve(layout.ballast)
        self._ballast.take_in()

    def expired(self, retention_s: float, most: int) -> list[str]:
        """Give ids of what was finished longer ago than the retention, oldest first."""
        if not self._account.settled(retention_s):
            return []
        # By the store's own count of seconds and by the wall clock both, unless that was set back
        # behind what it said then: a clock that is wrong for a while removes nothing.
        now = self._account.wall()
        return self._database.ids(
            "SELECT capture_id FROM outcomes WHERE finished_age_s <= ?"
            " AND (julianday(?) - julianday(finished_at) >= ? OR finished_at > ?)"
            " ORDER BY sequence LIMIT ?",
            self._account.now() - retention_s, stamp(now), retention_s / 86400, stamp(now), most)

    def accepted_before(self, moment: datetime | None, most: int) -> list[str]:
        """Give ids of what was accepted before a time, oldest first; all where it is None."""
        limit = stamp(moment) if moment else "a"  # later than any number
        return self._database.ids(
            "SELECT capture_id FROM captures WHERE state != ? AND accepted_at < ?"
            " ORDER BY position LIMIT ?", CaptureState.REMOVED, limit, most)

    def remove(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        """Mark rows, which nothing but `erase` and `sweep` sees from now on."""
        self._ballast.overboard(lambda: self._mark(capture_ids, state))

    def erase(self, capture_ids: Sequence[str]) -> None:
        """Remove the files of what was removed, then the rows."""
        self._ballast.overboard(lambda: self._finish(capture_ids))

    def sweep(self, retention_s: float | None) -> None:
        """Finish what `remove` began; remove what is in quarantine for longer than that."""
        self._ballast.overboard(lambda: self._finish(self._database.ids(
            "SELECT capture_id FROM captures WHERE state = ?", CaptureState.REMOVED)))
        self._database.set_meta("clock", self._account.save())
        if retention_s is not None and self._account.settled(retention_s):
            with naming(self._layout.quarantine):
                self._quarantine.remove_older(retention_s)

    def finish(self, capture_id: str) -> None:
        """Finish what `remove` began of one capture, if anything: its id comes again."""
        self._finish(self._database.ids(
            "SELECT capture_id FROM captures WHERE state = ? AND capture_id = ?",
            CaptureState.REMOVED, capture_id))

    def clear_quarantine(self) -> None:
        """Remove all that is in quarantine."""
        with naming(self._layout.quarantine):
            self._quarantine.clear()

    def _mark(self, capture_ids: Sequence[str], state: CaptureState) -> None:
        with self._database.transaction() as database:
            for capture_id in capture_ids:
                database.execute("DELETE FROM outcomes WHERE capture_id = ?", (capture_id,))
                database.execute(
                    "UPDATE captures SET state = ? WHERE capture_id = ?", (state, capture_id))

    def _finish(self, capture_ids: Sequence[str]) -> None:
        """Remove the files, then the rows: a row of a file that is gone says so in its state."""
        if not capture_ids:
            return
        self._forget(capture_ids)
        for capture_id in capture_ids:
            row = self._database.one(
                "SELECT settings_hash FROM captures WHERE capture_id = ?", capture_id)
            paths = [self._layout.frame(capture_id)]
            if row:
                paths.append(self._layout.face(capture_id, row["settings_hash"]))
            for path in paths:
                with naming(path):
                    path.unlink(missing_ok=True)
        for folder in (self._layout.frames, self._layout.faces):
            with naming(folder):
                sync_folder(folder)
        with naming(self._layout.quarantine):
            self._quarantine.remove(capture_ids)
        with self._database.transaction() as database:
            database.executemany(
                "DELETE FROM captures WHERE capture_id = ? AND state = 'removed'",
                [(capture_id,) for capture_id in capture_ids])
        self._database.truncate_log()
