"""Atomic and durable writes; files and folders for this user alone."""

import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from denseface.files import open_regular, write_whole
from denseface.service.errors import KeyFileError, SettingsError, UsageError, reason_of
from denseface.service.runtime._direct_io import write_direct
from denseface.service.runtime.failpoints import failpoint

__all__ = ["check_outside_hub", "check_unwritable", "private_folder", "read_private_text",
           "socket_folder", "sync_folder", "write_atomically", "write_synced"]

_MAX_TEXT_BYTES = 4096
"""Of a private text; longer than any key file."""
_OF_A_HUB = "frames", "faces", "quarantine", "lock"
"""What every data folder has in it."""
_OTHERS = 0o077
"""Mode bits that a folder for this user alone may not have."""
_WRITABLE = 0o022
"""Mode bits that let others put something into a folder."""


def write_atomically(
    path: Path, chunks: Sequence[bytes | memoryview], *, mode: int | None = None
) -> None:
    """Write a file of this program's own as `write_whole` does, and sync its folder.

    Parameters
    ----------
    mode : of the file, exactly; None for 666 less the umask

    Raises
    ------
    OSError
        As from the system, and it names `path`. The old contents, or all of the new, are left.
    """
    write_whole(path, chunks, mode=mode, folders=False)
    sync_folder(path.parent)


def write_synced(path: Path, chunks: Sequence[bytes | memoryview], *, failpoints: str = "") -> None:
    """Write and sync a file for this user alone, past the page cache where the file system can.

    Half of it may be left, by a kill or where a disk that fails does not remove it either: the next
    write does. The folder is not synced.

    Parameters
    ----------
    failpoints : prefix of the names of this write's failpoints

    Raises
    ------
    OSError
        As from the system.
    """
    path.unlink(missing_ok=True)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        with os.fdopen(os.open(path, flags, 0o600), "wb") as file:
            if not write_direct(file.fileno(), chunks):
                for chunk in chunks:
                    file.write(chunk)
                file.flush()
            failpoint(f"{failpoints}.written")
            os.fsync(file.fileno())
            failpoint(f"{failpoints}.synced")
    except BaseException:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        raise


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder; OSError where that fails."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def check_outside_hub(path: Path) -> None:
    """Check that a file for a user is not to be written into a hub's data folder.

    Nothing would ever remove it from there: the hub leaves alone what is not its own.

    Raises
    ------
    UsageError
        It is.
    """
    for folder in Path(os.path.realpath(path)).parents:  # a loop of links ends it, too
        with suppress(OSError):
            if all((folder / name).exists() for name in _OF_A_HUB):
                raise UsageError(
                    f"{path}: {folder} is a hub's data folder, and what others put there is never "
                    "removed, whatever the retention: name a file in another folder")


def private_folder(path: Path) -> Path:
    """Create a folder that only this user can enter, or check that one is, and give it.

    The mode of a folder that exists is its owner's affair and stays as it is.

    Raises
    ------
    SettingsError
        Where it is no folder, belongs to another user, is open to others or can be exchanged by
        them, or cannot be created.
    """
    mode = _own_folder(path)
    if mode & _OTHERS:
        raise SettingsError(f"{path}: others may use this folder (mode {mode:o}), and private data "
                            f"is to be kept in it: name another one, or chmod 700 {path}")
    _check_parents(path)
    return path


def socket_folder(path: Path) -> Path:
    """Create a folder as `private_folder` does, or check that nobody else can put a socket there.

    Others may look into it: a socket's own mode says who may connect.

    Raises
    ------
    SettingsError
        Where it is no folder, belongs to another user, others may write there, or it cannot be
        created.
    """
    _own_folder(path)
    check_unwritable(path)
    return path


def check_unwritable(path: Path, forbidden: int = _WRITABLE) -> None:
    """Check that nobody else may put something into a folder, or exchange it.

    SettingsError where its mode has one of the bits in `forbidden`, or it cannot be read.
    """
    mode = _mode_of(path)
    if mode & forbidden:
        raise SettingsError(f"{path}: others may write there (mode {mode:o}): name a folder of "
                            "your own, with mode 700")
    _check_parents(path)


def _check_parents(path: Path) -> None:
    """Check that nobody may rename a folder or one above it: the sticky bit forbids that."""
    for parent in path.resolve().parents:
        mode = _mode_of(parent)
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise SettingsError(f"{path}: {parent}: others may exchange what is in it "
                                f"(mode {mode:o}): choose another place, or chmod o-w {parent}")


def _own_folder(path: Path) -> int:
    """Create a folder with mode 700, or check that it is this user's; give its mode."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except FileExistsError as error:
        raise SettingsError(f"{path}: is a file, expected a folder") from error
    except OSError as error:
        raise SettingsError(f"{path}: {reason_of(error)}") from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise SettingsError(f"{path}: must be a folder of user {os.getuid()}")
    return stat.S_IMODE(found.st_mode)


def _mode_of(path: Path) -> int:
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except OSError as error:
        raise SettingsError(f"{path}: {reason_of(error)}") from error


def read_private_text(path: Path, forbidden: int) -> bytes:
    """Read a key file unless its mode has one of the bits in `forbidden`.

    Raises
    ------
    KeyFileError
        Where it is no regular file, too long, another user's or open to others.
    """
    try:
        with open_regular(path) as file:
            found = os.fstat(file.fileno())
            text = file.read(_MAX_TEXT_BYTES + 1)
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error
    if len(text) > _MAX_TEXT_BYTES:
        raise KeyFileError(f"{path}: expected a key file of at most {_MAX_TEXT_BYTES} bytes")
    if forbidden and found.st_uid != os.getuid():
        raise KeyFileError(f"{path}: belongs to user {found.st_uid}, expected {os.getuid()}")
    if found.st_mode & forbidden:
        raise KeyFileError(
            f"{path}: others may use this key (mode {found.st_mode & 0o777:o}): expected 600, "
            "and if others had access make a new key")
    return text
