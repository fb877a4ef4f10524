"""Files that are whole or not there, and files and folders for this user alone."""

import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from denseface.service.errors import KeyFileError, SettingsError, reason_of
from denseface.service.runtime._direct_io import write_direct
from denseface.service.runtime.failpoints import failpoint

__all__ = ["private_folder", "read_private_text", "sync_folder", "write_atomically",
           "write_private_text"]

_MOST_TEXT_BYTES = 4096
"""Of a private text: more than any key file."""


def write_atomically(
    path: Path, chunks: Sequence[bytes | memoryview], *, durable: bool = True, named: bool = True,
    direct: bool = False, mode: int = 0o666, steps: str = "",
) -> None:
    """Write a file so that `path` is ever either the old contents or all of the new.

    With `durable`, it is on the disk, and with `named` so is its name, when this returns; without,
    that is left to `sync_folder`. With `direct` it does not pass through the page cache where that
    can be had. `mode`, less the umask, is that of the file. `steps` begins the names of this
    write's failpoints.

    Raises
    ------
    OSError
        As from the system; nothing half-written stays, though all of it may.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with os.fdopen(os.open(temporary, flags, mode), "wb") as file:
            if not (direct and write_direct(file.fileno(), chunks)):
                for chunk in chunks:
                    file.write(chunk)
                file.flush()
            failpoint(f"{steps}.written")
            if durable:
                os.fsync(file.fileno())
                failpoint(f"{steps}.synced")
        temporary.replace(path)
        failpoint(f"{steps}.renamed")
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    if durable and named:
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk; OSError where that fails."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def private_folder(path: Path) -> Path:
    """Create a folder that only this user can enter, or check that it is one.

    Raises
    ------
    SettingsError
        Where it is no folder, belongs to someone else or cannot be made.
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


def write_private_text(path: Path, text: str) -> None:
    """Write a file of mode 0600, whole or not at all.

    Raises
    ------
    KeyFileError
        Where it cannot be written.
    """
    try:
        write_atomically(path, [text.encode()], mode=0o600)
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error


def read_private_text(path: Path, forbidden: int) -> bytes:
    """Read a small file unless others have one of the `forbidden` permissions.

    Raises
    ------
    KeyFileError
        Where it is no regular file, too long, not ours or open to others.
    """
    try:
        with path.open("rb") as file:
            found = os.fstat(file.fileno())
            text = file.read(_MOST_TEXT_BYTES + 1) if stat.S_ISREG(found.st_mode) else b""
    except OSError as error:
        raise KeyFileError(f"{path}: {reason_of(error)}") from error
    if not stat.S_ISREG(found.st_mode) or len(text) > _MOST_TEXT_BYTES:
        raise KeyFileError(f"{path}: expected a key file of at most {_MOST_TEXT_BYTES} bytes")
    if forbidden and found.st_uid != os.getuid():
        raise KeyFileError(f"{path}: belongs to user {found.st_uid}, expected {os.getuid()}")
    if found.st_mode & forbidden:
        raise KeyFileError(
            f"{path}: others may use this key (mode {found.st_mode & 0o777:o}): expected 600, "
            "and if others had access make a new key")
    return text
