"""Files from outside are bounded; files that are written are whole or not there.

What is opened may be a device, a pipe that nobody writes to, or larger than the memory. What is
written may go into a folder into which others write too: they can know no name beforehand.
"""

import errno
import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

__all__ = ["open_regular", "read_bounded", "replacing", "replacing_by_name"]

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
"""Fails where the name is taken, by whatever it is."""


def open_regular(path: str | Path) -> BufferedReader:
    """Open a file to read, and nothing that is none; never waits.

    Raises
    ------
    OSError
        As from the system, and where it is a folder, a device, a pipe or a socket.
    """
    # Without O_NONBLOCK, opening a pipe waits for its writer.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "Not a regular file", str(path))


def read_bounded(path: str | Path, max_bytes: int) -> bytes:
    """Read a whole file.

    Raises
    ------
    OSError
        As from `open_regular`, and where it has more than `max_bytes`.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        # `read` allocates what it is asked for; one byte more shows a file that grows.
        data = file.read(size + 1) if size <= max_bytes else b""
    if max(size, len(data)) > max_bytes:
        raise OSError(errno.EFBIG, f"Has more than {max_bytes} bytes", str(path))
    return data


@contextmanager
def replacing(path: Path, mode: int | None = None) -> Iterator[BinaryIO]:
    """Give a new file, which takes the place of `path` at the end of the block.

    Where the block raises, nothing of it is left and `path` is as it was. Whether the file is
    synced is left to the caller.

    Parameters
    ----------
    mode : of the file, exactly; None for 666 less the umask

    Raises
    ------
    OSError
        As from the system.
    """
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    descriptor = os.open(temporary, _NEW, 0o666 if mode is None else mode)
    try:
        with os.fdopen(descriptor, "wb") as file:
            if mode is not None:
                with suppress(PermissionError):  # a file system without modes
                    os.fchmod(descriptor, mode)  # whatever the umask
            yield file
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


@contextmanager
def replacing_by_name(path: Path) -> Iterator[Path]:
    """As `replacing`, for a library that makes its file itself: give the name for it.

    It is in a new folder that only this user may enter. The file is synced: a library may not have
    been told that it could not be written.
    """
    with tempfile.TemporaryDirectory(prefix=".", suffix=".tmp", dir=path.parent) as folder:
        temporary = Path(folder) / f"file{path.suffix}"
        yield temporary
        with open_regular(temporary) as file:
            os.fsync(file.fileno())
        temporary.replace(path)
