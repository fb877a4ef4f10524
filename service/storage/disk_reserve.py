"""A file thrown overboard when the disk is full: what makes room needs room itself."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import structlog

from denseface.service.errors import DiskFullError

__all__ = ["DiskReserve"]

_BYTES = 2**20


class DiskReserve:
    """One MiB, put back as soon as there is room again."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def take_in(self) -> None:
        """Make sure that it is there; without room it is not."""
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

    def overboard(self, action: Callable[[], None]) -> None:
        """Do what makes room, without ballast where there is no room for it."""
        try:
            action()
        except DiskFullError as error:
            structlog.get_logger("store").warning("ballast thrown overboard", reason=str(error))
            with suppress(OSError):
                self._path.unlink(missing_ok=True)
            action()
        finally:
            self.take_in()
