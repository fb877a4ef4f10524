"""Files from outside are bounded; files that are written are whole or not there.

What is opened may be a device, a pipe that nobody writes to, or larger than the memory. What is
written may go into a folder into which others write too: they can know no name beforehand.
"""

import errno
import os
import secrets
import stat
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import BufferedReader
from pathlib import Path

__all__ = ["check_place", "make_folder", "open_regular", "read_bounded", "sync",
           "write_all", "write_whole"]

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


def write_whole(
    path: Path, chunks: Sequence[bytes | memoryview], *, mode: int | None = None,
    synced: bool = True, folders: bool = True,
) -> None:
    """Write a file so that `path` has either its old contents or all of the new.

    That all of it was taken is asked of the system: each write, the sync, the size and the closing
    may say that it was not. Where one does, nothing of the new contents is left.

    Parameters
    ----------
    mode : of the file, exactly; None for 666 less the umask
    synced : wait until the contents are on the disk; the name may follow later
    folders : make those that are missing, for those who may read the file

    Raises
    ------
    OSError
        As from the system, and it names `path`.
    """
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        if folders:
            make_folder(path.absolute().parent, mode)
        descriptor = os.open(temporary, _NEW, 0o666 if mode is None else mode)
        try:
            _fill(descriptor, chunks, mode, synced=synced)
            temporary.replace(path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise _named(error, path) from error


def write_all(files: Mapping[Path, bytes], *, mode: int | None = None) -> None:
    """Write files that belong together, in their order: the one that names the others last.

    All are on the disk before the first takes its name, so that a full disk leaves what was there;
    each is whole, whatever happens between two of them.

    Raises
    ------
    OSError
        As `write_whole`; it names the file that could not be written.
    """
    kept: dict[Path, Path] = {}
    try:
        for path, data in files.items():
            temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
            try:
                make_folder(path.absolute().parent, mode)
                descriptor = os.open(temporary, _NEW, 0o666 if mode is None else mode)
                kept[temporary] = path
                _fill(descriptor, [data], mode, synced=True)
                if path.is_dir():
                    raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            except OSError as error:
                raise _named(error, path) from error
        for temporary, path in list(kept.items()):
            try:
                temporary.replace(path)
            except OSError as error:
                raise _named(error, path) from error
            del kept[temporary]
    finally:
        for temporary in kept:
            with suppress(OSError):
                temporary.unlink()


def _fill(
    descriptor: int, chunks: Sequence[bytes | memoryview], mode: int | None, *, synced: bool
) -> None:
    """Write all of a new file and close it; OSError where any of that is not so."""
    size = 0
    try:
        if mode is not None:
            with suppress(PermissionError):  # a file system without modes
                os.fchmod(descriptor, mode)  # whatever the umask
        for chunk in chunks:
            rest = memoryview(chunk).cast("B")
            size += len(rest)
            while rest:
                rest = rest[os.write(descriptor, rest):]
        if synced:
            os.fsync(descriptor)
        _check_size(descriptor, size)
    except BaseException:
        with suppress(OSError):
            os.close(descriptor)
        raise
    os.close(descriptor)  # where it fails, the descriptor is closed all the same


def _check_size(descriptor: int, expected: int) -> None:
    size = os.fstat(descriptor).st_size
    if size != expected:
        raise OSError(errno.EIO, f"Has {size} of {expected} bytes after they were written")


def sync(path: Path) -> None:
    """Wait until a file's contents, or the names in a folder, are on the disk.

    Raises
    ------
    OSError
        As from the system, also of what was written before and is lost; it names `path`.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise _named(error, path) from error


def make_folder(folder: Path, mode: int | None = None) -> None:
    """Make a folder, and those above it, where they are missing.

    Parameters
    ----------
    mode : of the files that are to be in it: who may read these may enter it; None for 777 less the
        umask

    Raises
    ------
    OSError
        As from the system.
    """
    if folder.is_dir():
        return
    make_folder(folder.parent, mode)
    try:
        folder.mkdir(0o777 if mode is None else mode | (mode & 0o444) >> 2)
    except FileExistsError:
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"{folder} is no folder") from None


def check_place(path: Path, least_bytes: int = 0) -> None:
    """Check that a file can be written, before there is anything to write; leaves nothing behind.

    Parameters
    ----------
    path : its folder may be missing: then it must be possible to make one
    least_bytes : for which there must be room

    Raises
    ------
    OSError
        As from the system, and it names `path`.
    """
    try:
        folder = path.absolute().parent
        while not os.path.lexists(folder):
            folder = folder.parent
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"{folder} is no folder")
        temporary = folder / f".{secrets.token_hex(8)}.tmp"
        descriptor = os.open(temporary, _NEW, 0o600)
        try:
            temporary.unlink()
            _reserve(descriptor, least_bytes)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise _named(error, path) from error


def _reserve(descriptor: int, size: int) -> None:
    """Take room for a file; OSError where there is none."""
    try:
        if size:
            os.posix_fallocate(descriptor, 0, size)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # not on this file system
            raise


def _named(error: OSError, path: Path) -> OSError:
    """Give the same error of the file that was asked for, not of one with another name."""
    return OSError(error.errno or errno.EIO, error.strerror or str(error), str(path))
