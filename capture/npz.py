"""The frame file: one `RgbdFrame` in a `.npz`, without pickles.

Files come from outside. Each array's header is checked before one byte of it is unpacked, and no
more than that header announces is read.
"""

import os
import struct
import zipfile
import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from denseface.capture.calibration import MAX_SIDE, Calibration, ChosenCalibration
from denseface.capture.errors import CaptureError, FrameError, UnreadableSourceError
from denseface.capture.frame import RgbdFrame
from denseface.capture.source import Source
from denseface.files import replacing

__all__ = ["NpzSource", "load_frame", "save_frame"]

_MAX_BYTES = 256 * 2**20
"""Bytes of an array of numbers."""
_MAX_TEXT_BYTES = 1 << 20
"""Bytes of the calibration, 4 a character."""
_MAX_HEADER_BYTES = 4096
"""Bytes of an array's header."""
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Reader of an array's header by its version."""


class _Kind(NamedTuple):
    dtype: str
    shape: str
    ndim: int


_KEYS = {
    "depth": _Kind("uint16", "(H, W)", 2),
    "color": _Kind("uint8", "(H, W, 3)", 3),
    "depth_timestamp_us": _Kind("int64", "()", 0),
    "color_timestamp_us": _Kind("int64", "()", 0),
    "calibration": _Kind("str", "()", 0),
    "registered": _Kind("bool", "()", 0),
}


class NpzSource(Source):
    """The one frame of a `.npz` file as a source."""

    frame_count = 1

    def __init__(self, path: Path, chosen: ChosenCalibration | None = None) -> None:
        self.uri = str(path)
        self._frame = load_frame(path, chosen)

    def __iter__(self) -> Iterator[RgbdFrame]:
        yield self._frame

    def close(self) -> None:
        """Nothing is held open."""


def load_frame(path: str | Path, chosen: ChosenCalibration | None = None) -> RgbdFrame:
    """Read a frame file.

    Parameters
    ----------
    chosen : a calibration that wins over the file's own

    Raises
    ------
    UnreadableSourceError
        Missing, truncated, or not a zip archive of NumPy arrays.
    FrameError
        A key is missing, unknown, or has not the dtype and shape of the format.
    CalibrationError
        The file's own calibration is used and is not one.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            optional = ("registered",) if chosen is None else ("registered", "calibration")
            arrays = _read_arrays(Path(path), archive, optional)
    except CaptureError:
        raise
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError,
            RuntimeError, ValueError, struct.error) as error:
        why = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise UnreadableSourceError(f"{path}: not a readable .npz file: {why}") from error
    calibration, origin = chosen or (_own_calibration(path, arrays["calibration"]), "npz file")
    try:
        return RgbdFrame(
            arrays["depth"], arrays["color"],
            int(arrays["depth_timestamp_us"]), int(arrays["color_timestamp_us"]),
            calibration, bool(arrays.get("registered", False)), calibration_origin=origin,
        )
    except FrameError as error:
        raise FrameError(f"{path}: {error} (calibration: {origin})") from error


def save_frame(path: str | Path, frame: RgbdFrame) -> None:
    """Write a frame file: whole, or not at all; OSError as from the system."""
    with replacing(Path(path)) as file:
        np.savez_compressed(
            file, allow_pickle=False, depth=frame.depth, color=frame.color,
            depth_timestamp_us=np.int64(frame.depth_timestamp_us),
            color_timestamp_us=np.int64(frame.color_timestamp_us),
            calibration=np.array(frame.calibration.to_json()),
            registered=np.bool_(frame.registered),
        )
        file.flush()
        os.fsync(file.fileno())


def _own_calibration(path: str | Path, array: NDArray[Any]) -> Calibration:
    try:
        text = str(array)
    except (ValueError, SystemError) as error:
        raise FrameError(f"{path}: calibration: not Unicode text") from error
    return Calibration.from_json(text, name=f"{path}: calibration")


def _read_arrays(
    path: Path, archive: zipfile.ZipFile, optional: tuple[str, ...]
) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}
    for member in archive.infolist():
        name = member.filename
        key = name.removesuffix(".npy")
        if key not in _KEYS or key == name or key in arrays:
            raise FrameError(f"{path}: unexpected entry {name!r}; expected keys: "
                             + ", ".join(_KEYS))
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise UnreadableSourceError(
                f"{path}: {key}: zip compression {member.compress_type}, expected 0 or 8 (deflate)")
        with archive.open(member) as file:
            arrays[key] = _read_array(f"{path}: {key}", file, _KEYS[key])
    for key, kind in _KEYS.items():
        if key not in arrays and key not in optional:
            raise FrameError(f"{path}: key {key!r} is missing, expected {kind.dtype} {kind.shape}")
    return arrays


def _read_array(name: str, file: IO[bytes], kind: _Kind) -> NDArray[Any]:
    try:
        version = npy.read_magic(file)
        shape, fortran, dtype = _HEADERS[version](file, max_header_size=_MAX_HEADER_BYTES)
    except OSError:
        raise
    except Exception as error:  # the header is parsed as Python, which may raise anything
        raise UnreadableSourceError(f"{name}: not a NumPy array") from error
    expected = f"expected {kind.dtype} {kind.shape}"
    found = f"found {dtype} {shape}"
    right_dtype = dtype.kind == "U" if kind.dtype == "str" else dtype == np.dtype(kind.dtype)
    if dtype.hasobject or not right_dtype or len(shape) != kind.ndim:
        raise FrameError(f"{name}: {expected}, {found}")
    limit = _MAX_TEXT_BYTES if kind.dtype == "str" else _MAX_BYTES
    size = prod(shape) * dtype.itemsize
    if (not all(0 < side <= MAX_SIDE for side in shape) or size > limit
            or (kind.ndim == 3 and shape[2] != 3)):
        raise FrameError(f"{name}: {expected} with sides of 1 to {MAX_SIDE} and at most "
                         f"{limit} bytes, {found}")
    data = file.read(size)
    # Reading past the announced size makes `zipfile` check the member's CRC.
    if len(data) != size or file.read(1):
        raise UnreadableSourceError(f"{name}: {found} needs {size} bytes, the file holds "
                                    f"{'fewer' if len(data) < size else 'more'}")
    flat = np.frombuffer(data, dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="C")
