"""A lock that one hub at a time has on a data folder."""

import fcntl
import os
from pathlib import Path

from denseface.service.errors import HubRunningError, SettingsError, reason_of
from denseface.service.runtime.files import private_folder

__all__ = ["check_folder", "lock"]


def check_folder(folder: Path) -> None:
    """Create a data folder, or check that a hub could open it.

    Raises
    ------
    SettingsError
        Where it cannot be created, opened or is another user's.
    HubRunningError
        Where a hub has it open.
    """
    os.close(lock(private_folder(folder) / "lock"))


def lock(path: Path) -> int:
    """Lock a data folder by a file in it, until the descriptor returned is closed.

    Raises as `check_folder`.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise SettingsError(f"{path}: {reason_of(error)}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise HubRunningError(f"{path.parent}: another hub has this data folder open") from error
    return descriptor
