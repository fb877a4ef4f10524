"""Erases what was withdrawn: files, then rows, then the write-ahead log that still names them.

It may run in any thread, beside the hub's loop: it has a connection to the database of its own.
While a file is left so is its row, which says REMOVED: wherever a hub is killed, nothing that was
withdrawn can be read again, and the next hub goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.files import sync_folder
from denseface.service.storage._database import Database
from denseface.service.storage._disk_reserve import DiskReserve
from denseface.service.storage._folder_layout import FolderLayout
from denseface.service.storage._quarantine import Quarantine
from denseface.service.storage._record_file import wrap_os_errors

_UNLINKING = 8
"""Files that are removed at the same time."""


@dataclass(frozen=True)
class Erasure:
    """What is to be erased; with no captures, the write-ahead log is emptied."""

    captures: Mapping[str, str | None]
    """Capture id -> hash of the settings of its face; None where no row says it."""
    number: int
    quarantined_before_s: float | None = None
    """Also what came to quarantine when the store was younger than this, seconds."""
    all_quarantined: bool = False


@dataclass(frozen=True)
class Erased:
    """What became of an `Erasure`."""

    erasure: Erasure
    without_row: int = 0
    """Captures that had a file and no row."""
    log_emptied: bool = False
    """Else another program reads the database: what was erased is still named in its log."""
    error: Exception | None = None
    """A StoreError where the disk or file system failed."""


@dataclass(frozen=True)
class PendingErasure:
    """An erasure that has not begun."""

    erasure: Erasure
    erase: Callable[[Erasure], Erased]

    def run(self) -> Erased:
        """Erase; errors are in what is returned."""
        return self.erase(self.erasure)


class Eraser:
    """Erases in one data folder."""

    def __init__(
        self, layout: FolderLayout, database: Database, quarantine: Quarantine, reserve: DiskReserve
    ) -> None:
        self._layout = layout
        self._database = database
        self._quarantine = quarantine
        self._reserve = reserve

    def __call__(self, erasure: Erasure) -> Erased:
        """Erase; errors are in what is returned."""
        found: list[int] = []
        try:
            self._reserve.spend_on(lambda: found.append(self._erase(erasure)))
            with closing(self._database.another()) as database:
                emptied = database.truncate_log()
        except Exception as error:
            return Erased(erasure, error=error)
        return Erased(erasure, found[-1], emptied)

    def _erase(self, erasure: Erasure) -> int:
        without_row = 0
        if erasure.captures:
            # That they are withdrawn is synced here, not on the hub's loop, and before any file
            # goes: the log is synced up to this commit.
            with closing(self._database.another()) as database:
                database.set_meta("erasure", str(erasure.number))
            failpoint("hub.removal.begun")
            without_row = self._erase_files(erasure.captures)
            failpoint("hub.removal.files")
        with wrap_os_errors(self._layout.quarantine):
            if erasure.all_quarantined:
                self._quarantine.clear()
            elif erasure.quarantined_before_s is not None:
                self._quarantine.remove_before(erasure.quarantined_before_s)
            if erasure.captures:
                self._quarantine.remove(erasure.captures)
        if erasure.captures:
            with closing(self._database.another()) as database, \
                    database.transaction() as connection:
                connection.executemany(
                    "DELETE FROM captures WHERE capture_id = ? AND state = 'removed'",
                    [(capture_id,) for capture_id in erasure.captures])
            failpoint("hub.removal.rows")
        return without_row

    def _erase_files(self, captures: Mapping[str, str | None]) -> int:
        layout = self._layout
        unknown = {capture_id for capture_id, known in captures.items() if known is None}
        files = layout.faces_of(unknown) if unknown else []
        for capture_id, known in captures.items():
            files += [(capture_id, layout.frame(capture_id)),
                      (capture_id, layout.unnamed_frame(capture_id))]
            if known is not None:
                files += [(capture_id, layout.face(capture_id, known)),
                          (capture_id, layout.unnamed_face(capture_id, known))]
        found = _unlink_all([path for _, path in files])
        for folder in (layout.frames, layout.faces):
            with wrap_os_errors(folder):
                sync_folder(folder)
        return len({capture_id for (capture_id, _), one in zip(files, found, strict=True)
                    if one and capture_id in unknown})


def _unlink_all(paths: Sequence[Path]) -> list[bool]:
    """Remove files, as `_unlink` does each."""
    if len(paths) <= _UNLINKING:
        return [_unlink(path) for path in paths]
    # A file system that tells the disk of each block that is free waits for milliseconds in each
    # call; several calls wait together.
    with ThreadPoolExecutor(_UNLINKING, thread_name_prefix="unlink") as pool:
        return list(pool.map(_unlink, paths))


def _unlink(path: Path) -> bool:
    """Remove a file and say whether there was one; StoreError where it cannot be removed."""
    with wrap_os_errors(path), suppress(FileNotFoundError):
        path.unlink()
        return True
    return False
