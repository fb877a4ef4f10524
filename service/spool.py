"""Files that are whole or not there: several byte strings under one checksum.

Layout: the magic line, SHA-256 of all that follows it (32 bytes), the number of parts (uint32) and
the length of each (uint64), little-endian, then the parts.
"""

import hashlib
import os
import struct
from collections.abc import Sequence
from pathlib import Path

from service.errors import CorruptFileError, StoreError

__all__ = ["read_parts", "write_atomically", "write_parts"]

_MAGIC = b"denseface spool 1\n"
_DIGEST_BYTES = hashlib.sha256().digest_size


def write_atomically(path: Path, chunks: Sequence[bytes], *, durable: bool = True) -> None:
    """Write a file so that `path` is ever either the old contents or all of the new.

    With `durable`, it is on the disk, and so is its name, when this returns.

    Raises
    ------
    OSError
        As from the system; nothing half-written stays.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("xb") as file:
            for chunk in chunks:
                file.write(chunk)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if durable:
        _sync_folder(path.parent)


def write_parts(path: Path, parts: Sequence[bytes]) -> str:
    """Write parts durably and give their checksum, hexadecimal.

    Raises
    ------
    StoreError
        Where the disk is full or the file cannot be written.
    """
    index = struct.pack(f"<I{len(parts)}Q", len(parts), *map(len, parts))
    digest = hashlib.sha256(index)
    for part in parts:
        digest.update(part)
    try:
        write_atomically(path, [_MAGIC, digest.digest(), index, *parts])
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror or error}") from error
    return digest.hexdigest()


def read_parts(path: Path, checksum: str) -> list[bytes]:
    """Read what `write_parts` wrote.

    Raises
    ------
    CorruptFileError
        Where the file is missing or is not what had `checksum`.
    """
    try:
        data = memoryview(path.read_bytes())
    except OSError as error:
        raise CorruptFileError(f"{path}: {error.strerror or error}") from error
    start = len(_MAGIC) + _DIGEST_BYTES
    if data[:len(_MAGIC)] != _MAGIC or hashlib.sha256(data[start:]).hexdigest() != checksum:
        raise CorruptFileError(f"{path}: contents do not have the checksum {checksum[:12]}...")
    (count,) = struct.unpack_from("<I", data, start)
    lengths = struct.unpack_from(f"<{count}Q", data, start + 4)
    parts, start = [], start + 4 + 8 * count
    for length in lengths:
        parts.append(bytes(data[start:start + length]))
        start += length
    return parts


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
