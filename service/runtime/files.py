"""Atomic and durable writes; files and folders for this user alone."""

import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from denseface.service.errors import KeyFileError, SettingsError, reason_of
from denseface.service.runtime._direct_io import write_direct
from denseface.service.runtime.failpoints import failpoint

__all__ = ["private_folder", "read_private_text", "sync_folder", "write_atomically"]

_MAX_TEXT_BYTES = 4096
"""Of a private text; longer than any key file."""


def write_atomically(
    path: Path, chunks: Sequence[bytes | memoryview], *, durable: bool = True,
    sync_name: bool = True, direct: bool = False, mode: int = 0o666, failpoints: str = "",
) -> None:
    """Write a file so that `path` always has either its old contents or all of the new.

    Parameters
    ----------
    durable : sync the file before it gets its name
    sync_name : sync the folder too, if `durable`; else `sync_folder` is left to the caller
    direct : write past the page cache, where the file system can
    mode : of the file, less the umask
    failpoints : prefix of the names of this write's failpoints

    Raises
    ------
    OSError
        As from the system. The old contents, or all of the new, are left.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with os.fdopen(os.open(temporary, flags, mode), "wb") as file:
            if not (direct and write_direct(file.fileno(), chunks)):
                for chunk in chunks:
                    file.write(chunk)
                file.flush()
            failpoint(f"{failpoints}.written")
            if durable:
                os.fsync(file.fileno())
                failpoint(f"{failpoints}.synced")
        temporary.replace(path)
        failpoint(f"{failpoints}.renamed")
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    if durable and sync_name:
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder; OSError where that fails."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def private_folder(path: Path) -> Path:
    """Create a folder that only this user can enter, or make it one, and give it.

    Raises
    ------
    SettingsError
        Where it is no folder, belongs to another user or cannot be created.
    """
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
            raise SettingsError(f"{path}: must be a folder of user {os.getuid()}")
        if found.st_mode & 0o077:
            path.chmod(0o700)
    except OSError as error:
        raise SettingsError(f"{path}: {reason_of(error)}") from error
    return path


def read_private_text(path: Path, forbidden: int) -> bytes:
    """Read a key file unless its mode has one of the bits in `forbidden`.

    Raises
    ------
    KeyFileError
        Where it is no regular file, too long, another user's or open to others.
    """
    try:
        with path.open("rb") as file:
            found = os.fstat(file.fileno())
            text = file.read(_MAX_TEXT_BYTES + 1) if stat.S_ISREG(found.st_mode) else b""
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error
    if not stat.S_ISREG(found.st_mode) or len(text) > _MAX_TEXT_BYTES:
        raise KeyFileError(f"{path}: expected a key file of at most {_MAX_TEXT_BYTES} bytes")
    if forbidden and found.st_uid != os.getuid():
        raise KeyFileError(f"{path}: belongs to user {found.st_uid}, expected {os.getuid()}")
    if found.st_mode & forbidden:
        raise KeyFileError(
            f"{path}: others may use this key (mode {found.st_mode & 0o777:o}): expected 600, "
            "and if others had access make a new key")
    return text
