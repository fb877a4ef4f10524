"""Disk space held back for removals: on a full disk, even a removal needs some."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import structlog

from denseface.service.errors import DiskFullError

_BYTES = 2**20
"""Enough for SQLite to mark rows."""


class DiskReserve:
    """A file of one MiB that is removed where the disk is full and allocated again later."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def allocate(self) -> None:
        """Allocate the file unless it is there; on a full disk, leave it out."""
        with suppress(OSError):
            if self._path.exists() and self._path.stat().st_size == _BYTES:
                return
            descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                os.posix_fallocate(descriptor, 0, _BYTES)
            except OSError:
                self._path.unlink()
            finally:
                os.close(descriptor)

    def spend_on(self, action: Callable[[], None]) -> None:
        """Run an action that makes room; where the disk is full, once more without the reserve."""
        try:
            action()
        except DiskFullError as error:
            structlog.get_logger("store").warning("disk reserve released", reason=str(error))
            with suppress(OSError):
                self._path.unlink(missing_ok=True)
            action()
        finally:
            self.allocate()
