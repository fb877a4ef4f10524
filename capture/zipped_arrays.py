"""NumPy arrays in a `.npz`, without pickles, of kinds that are known beforehand.

Files come from outside. Each array's header is checked before one byte of it is unpacked, and no
more than that header announces is read.
"""

import io
import struct
import zipfile
import zlib
from collections.abc import Collection, Mapping
from math import prod
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from denseface.capture.errors import CaptureError, FrameError, UnreadableSourceError
from denseface.files import open_regular

__all__ = ["ArrayKind", "read_arrays", "read_npy_header"]

_MAX_BYTES = 256 * 2**20
"""Bytes of an array of numbers."""
_MAX_TEXT_BYTES = 1 << 20
"""Bytes of a text, 4 a character."""
_MAX_HEADER_BYTES = 4096
"""Bytes of an array's header."""
_MAX_DIRECTORY_BYTES = 1 << 17
"""Bytes of a zip's list of its members; more than the search for it reads."""
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Reader of an array's header by its version."""


class ArrayKind(NamedTuple):
    """What an array has to be."""

    dtype: str
    """NumPy's name of it, or `str` for a text of any length."""
    shape: tuple[str | int, ...] = ()
    """Each side, or its name where it may be any."""
    max_side: int = _MAX_BYTES
    """Of the sides that may be any."""

    def __str__(self) -> str:
        sides = ", ".join(map(str, self.shape))
        return f"{self.dtype} ({sides}{',' if len(self.shape) == 1 else ''})"


def read_arrays(
    path: str | Path, kinds: Mapping[str, ArrayKind], optional: Collection[str] = (), *,
    others: Mapping[str, str] | None = None,
) -> dict[str, NDArray[Any]]:
    """Read the arrays of a file, each under its key.

    Parameters
    ----------
    others : keys by which a file of another kind is known, and what to say of it

    Raises
    ------
    UnreadableSourceError
        Missing, truncated, or not a zip archive of NumPy arrays.
    FrameError
        A key is missing though not `optional`, unknown, or an array is not of its kind.
    """
    try:
        with _Archive(open_regular(path).detach()) as file, zipfile.ZipFile(file) as archive:
            file.largest_read = -1
            return _read_members(path, archive, kinds, optional, others or {})
    except CaptureError:
        raise
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError,
            RuntimeError, ValueError, struct.error) as error:
        if why := getattr(error, "strerror", None):
            raise UnreadableSourceError(f"{path}: {why}") from error
        raise UnreadableSourceError(
            f"{path}: no .npz file, or one that is damaged or cut short "
            f"({error or type(error).__name__})") from error


class _Archive(io.BufferedReader):
    """A file of which `zipfile` reads no longer list of members than there may be."""

    largest_read = _MAX_DIRECTORY_BYTES
    """Bytes that may be asked for at once; negative for any number."""

    def read(self, size: int | None = -1, /) -> bytes:
        if 0 <= self.largest_read < (size or 0):
            raise zipfile.BadZipFile(f"its list of members has {size} bytes")
        return super().read(size)


def _read_members(
    path: str | Path, archive: zipfile.ZipFile, kinds: Mapping[str, ArrayKind],
    optional: Collection[str], others: Mapping[str, str],
) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}
    places = [member.header_offset for member in archive.infolist()]
    if len(set(places)) < len(places):  # some versions of `zipfile` would warn, others raise
        raise UnreadableSourceError(f"{path}: entries of it lie over each other")
    for member in archive.infolist():
        name = member.filename
        key = name.removesuffix(".npy")
        if key in others and key not in kinds:
            raise FrameError(f"{path}: {others[key]}")
        if key not in kinds or key == name or key in arrays:
            raise FrameError(f"{path}: unexpected entry {name!r}; expected keys: "
                             + ", ".join(kinds))
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise UnreadableSourceError(
                f"{path}: {key}: zip compression {member.compress_type}, expected 0 or 8 (deflate)")
        with archive.open(member) as file:
            arrays[key] = _read_array(f"{path}: {key}", file, kinds[key])
    for key, kind in kinds.items():
        if key not in arrays and key not in optional:
            raise FrameError(f"{path}: key {key!r} is missing, expected {kind}")
    return arrays


def read_npy_header(name: str, file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the header of an array: shape, whether in Fortran's order, and dtype; never a pickle.

    Raises
    ------
    UnreadableSourceError
        Not the header of an array of plain values.
    """
    try:
        version = npy.read_magic(file)
        shape, fortran, dtype = _HEADERS[version](file, max_header_size=_MAX_HEADER_BYTES)
    except OSError:
        raise
    except Exception as error:  # the header is parsed as Python, which may raise anything
        raise UnreadableSourceError(f"{name}: not a NumPy array") from error
    return shape, fortran, dtype


def _read_array(name: str, file: IO[bytes], kind: ArrayKind) -> NDArray[Any]:
    shape, fortran, dtype = read_npy_header(name, file)
    found = f"found {dtype} {shape}"
    right_dtype = dtype.kind == "U" if kind.dtype == "str" else dtype == np.dtype(kind.dtype)
    # NumPy takes True for a side: to Python it is the integer 1.
    if (dtype.hasobject or not right_dtype or len(shape) != len(kind.shape)
            or any(type(side) is not int for side in shape)):
        raise FrameError(f"{name}: expected {kind}, {found}")
    limit = _MAX_TEXT_BYTES if kind.dtype == "str" else _MAX_BYTES
    size = prod(shape) * dtype.itemsize
    if size > limit or not all(
            side == wanted if isinstance(wanted, int) else 0 < side <= kind.max_side
            for side, wanted in zip(shape, kind.shape, strict=True)):
        raise FrameError(f"{name}: expected {kind} with sides of 1 to {kind.max_side} and at most "
                         f"{limit} bytes, {found}")
    data = file.read(size)
    # Reading past the announced size makes `zipfile` check the member's CRC.
    if len(data) != size or file.read(1):
        raise UnreadableSourceError(f"{name}: {found} needs {size} bytes, the file holds "
                                    f"{'fewer' if len(data) < size else 'more'}")
    flat = np.frombuffer(data, dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="C")
