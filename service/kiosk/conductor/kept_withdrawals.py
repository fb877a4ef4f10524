"""Withdrawals that the hub has not answered yet: kept as files, so that no restart forgets one."""

import re
from pathlib import Path

import structlog

from denseface.service.errors import reason_of
from denseface.service.runtime.files import private_folder, write_atomically

__all__ = ["KeptWithdrawals"]

_CAPTURE_ID = re.compile("[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_log = structlog.get_logger("kiosk")


class KeptWithdrawals:
    """A folder with a file for each capture, named by it; the file names the hub that has it.

    Parameters
    ----------
    folder : the kiosk's, mode 700
    address : of the hub

    Raises
    ------
    SettingsError
        Where the folder cannot be had for this user alone.
    """

    def __init__(self, folder: Path, address: str) -> None:
        self._folder = private_folder(private_folder(folder) / "withdrawals")
        self._address = address.encode()

    def begin(self, capture_id: str) -> None:
        """Remember a withdrawal. Where the disk refuses, it is remembered until the end alone."""
        try:
            write_atomically(self._folder / capture_id, [self._address], mode=0o600)
        except OSError as error:
            _log.error("a withdrawal would not outlive this process", reason=reason_of(error))

    def end(self, capture_id: str) -> None:
        """Forget one that was answered."""
        try:
            (self._folder / capture_id).unlink(missing_ok=True)
        except OSError as error:
            _log.warning("a withdrawal will be repeated", reason=reason_of(error))

    def pending(self) -> list[str]:
        """Give those of this hub that were not answered."""
        found = []
        for path in self._folder.iterdir():
            if not _CAPTURE_ID.fullmatch(path.name):
                continue
            try:
                if path.read_bytes() == self._address:
                    found.append(path.name)
            except OSError as error:
                _log.warning("a withdrawal cannot be read", reason=reason_of(error))
        return sorted(found)
