"""Files of several byte strings, their parts, under one checksum.

Layout: the magic line, the checksum (32 bytes), the index, which is the number of parts (uint32)
and the length of each (uint64), then the parts. The checksum is the SHA-256 of the index and of the
CRC-32 of each part (uint32). All numbers are little-endian.

The checksum finds damage, not forgery. A CRC-32 finds one or two wrong bits in a part and any run
of wrong bits up to 32 long; it misses other damage once in 2**32. The SHA-256 of the parts
themselves was a fifth of all that the hub computes for a capture.
"""

import errno
import hashlib
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from denseface.files import open_regular, read_bounded
from denseface.service.errors import (
    CorruptFileError,
    DiskFullError,
    StoreError,
    is_full,
    reason_of,
)
from denseface.service.runtime.files import write_synced

_MAGIC = b"denseface spool 3\n"
"""With the version of the layout."""
_DIGEST_BYTES = hashlib.sha256().digest_size
"""Size of a checksum."""
_HEAD_BYTES = 2**14
"""Read of a file at once for its head; more than a face's has."""
_MAX_BYTES = 128 * 2**20
"""Of a file; larger than any message."""


def write_parts(
    path: Path, parts: Sequence[bytes | memoryview], *, failpoints: str = ""
) -> str:
    """Write and sync parts, not their folder, and give their checksum, hexadecimal.

    `failpoints` and what an error leaves are those of `write_synced`; errors are those of
    `wrap_os_errors`.
    """
    index = struct.pack(f"<I{len(parts)}Q", len(parts), *map(len, parts))
    digest = _checksum(index, parts)
    with wrap_os_errors(path):
        write_synced(path, [_MAGIC, digest, index, *parts], failpoints=failpoints)
    return digest.hex()


def _checksum(index: bytes, parts: Sequence[bytes | memoryview]) -> bytes:
    sums = struct.pack(f"<{len(parts)}I", *map(zlib.crc32, parts))
    return hashlib.sha256(index + sums).digest()


def read_parts(path: Path, checksum: str | None = None) -> tuple[list[memoryview], str]:
    """Read a file that `write_parts` wrote: its parts and its checksum.

    Parameters
    ----------
    checksum : expected; where None, the one that the file states

    Raises
    ------
    CorruptFileError
        Where the file is missing, cannot be read or does not have the checksum.
    StoreError
        Where this process is out of descriptors or memory.
    """
    with _readable(path):
        data = memoryview(read_bounded(path, _MAX_BYTES))
    start = len(_MAGIC) + _DIGEST_BYTES
    magic, stated, body = data[:len(_MAGIC)], bytes(data[len(_MAGIC):start]).hex(), data[start:]
    parts = _split(body)
    if parts is not None and magic == _MAGIC:
        found = _checksum(bytes(body[:len(body) - sum(map(len, parts))]), parts).hex()
        if found == stated and found == (checksum or found):
            return parts, found
    raise CorruptFileError(
        f"{path}: contents do not have the checksum {(checksum or stated)[:12]}...")


@dataclass(frozen=True)
class FileHead:
    """The first parts of a file, as they are: only with all of them could damage be seen."""

    parts: list[memoryview]
    sizes: tuple[int, ...]
    """Of all parts, bytes."""
    checksum: str
    """As the file states it."""


def read_head(path: Path, count: int) -> FileHead:
    """Read the first parts of a file that `write_parts` wrote, however large it is.

    Raises as `read_parts`, CorruptFileError also where there are fewer parts or the file's size is
    not that of all of them.
    """
    start = len(_MAGIC) + _DIGEST_BYTES
    with _readable(path), open_regular(path) as file:
        descriptor, size = file.fileno(), os.fstat(file.fileno()).st_size
        data = os.pread(descriptor, _HEAD_BYTES, 0)
        sizes = _sizes(data[start:]) or ()
        first = start + 4 + 8 * len(sizes)
        end = first + sum(sizes[:count])
        if (data[:len(_MAGIC)] != _MAGIC or len(sizes) < count or first + sum(sizes) != size
                or size > _MAX_BYTES):
            raise CorruptFileError(f"{path}: its head is damaged or it is cut short")
        if end > len(data):
            data += os.pread(descriptor, end - len(data), len(data))
    return FileHead(_cut(memoryview(data)[first:end], sizes[:count]), sizes,
                    data[len(_MAGIC):start].hex())


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if isinstance(error, StoreError):
            raise
        transient = error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOMEM)
        raise (StoreError if transient else CorruptFileError)(
            f"{path}: {reason_of(error)}") from error


def _split(data: memoryview) -> list[memoryview] | None:
    """Give the parts after their index; None where their lengths do not add up to the data's."""
    sizes = _sizes(data)
    if sizes is None:
        return None
    start = 4 + 8 * len(sizes)
    return _cut(data[start:], sizes) if start + sum(sizes) == len(data) else None


def _sizes(data: memoryview | bytes) -> tuple[int, ...] | None:
    """Give what the index says; None where it is longer than the data."""
    try:
        (count,) = struct.unpack_from("<I", data)
        return struct.unpack_from(f"<{count}Q", data, 4)
    except struct.error:
        return None


def _cut(data: memoryview, sizes: Sequence[int]) -> list[memoryview]:
    parts, start = [], 0
    for size in sizes:
        parts.append(data[start:start + size])
        start += size
    return parts


@contextmanager
def wrap_os_errors(path: Path) -> Iterator[None]:
    """Raise each OSError as a StoreError that names `path`; of a full disk, as DiskFullError."""
    try:
        yield
    except OSError as error:
        reason = f"{path}: {reason_of(error)}"
        if is_full(error.errno):
            raise DiskFullError(f"no room on the disk ({reason})") from error
        if error.errno == errno.EIO:
            raise StoreError(f"the disk fails ({reason})") from error
        raise StoreError(reason) from error
