"""Reads what `encode_face_grid` writes, made from `docs/wire.md` alone."""

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FaceGrid", "read_face_grid"]

_MAX_HEADER, _MAX_PLACES, _MAX_SEEDS, _REACH = 4096, 2**25, 2**22, 2**28
_DEFLATE_RATIO = 1032


@dataclass(frozen=True, eq=False)
class FaceGrid:
    """points (n, 3) float64, mm; colors (n, 3) uint8; sigma (n,) mm; cells (n, 2); seeds alike."""

    points: NDArray[np.float64]
    colors: NDArray[np.uint8]
    sigma: NDArray[np.float64]
    cells: NDArray[np.intp]
    seeds: NDArray[np.float64]
    seed_colors: NDArray[np.uint8]
    header: dict[str, Any]


def read_face_grid(data: bytes) -> FaceGrid:
    """ValueError for anything that is no such file, before memory is taken for its claims."""
    if len(data) < 12 or data[:4] != b"DFGR":
        raise ValueError("no face grid")
    version, length = struct.unpack("<II", data[4:12])
    if version != 1:
        raise ValueError(f"version {version}, expected 1")
    if length > min(_MAX_HEADER, len(data) - 12):
        raise ValueError(f"header of {length} bytes")
    header = json.loads(data[12:12 + length])
    if not isinstance(header, dict):
        raise ValueError("header is no object")  # noqa: TRY004 - a fault of the file
    rows, columns = (_whole(header, name, 1, _MAX_PLACES) for name in ("rows", "columns"))
    if rows * columns > _MAX_PLACES:
        raise ValueError(f"{rows} x {columns} places")
    n = _whole(header, "points", 0, rows * columns)
    seeds = _whole(header, "seeds", 0, _MAX_SEEDS)
    longs = _whole(header, "long", 0, n)
    seed_longs = _whole(header, "long_of_seeds", 0, 3 * seeds)
    low, high = header["sigma_mm"]
    if not 0 < low <= high < np.inf:
        raise ValueError("sigma_mm")
    sizes = [rows * -(-columns // 8), n, 3 * n, n, 4 * longs, 3 * seeds, 3 * seeds, 4 * seed_longs]
    packed = data[12 + length:]
    if sum(sizes) > _DEFLATE_RATIO * len(packed):
        raise ValueError("more claimed than there can be")
    unpacker = zlib.decompressobj()
    try:
        body = unpacker.decompress(packed, sum(sizes) + 1)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if len(body) != sum(sizes) or not unpacker.eof or unpacker.unused_data:
        raise ValueError("body of another length than its header says")
    parts = [np.frombuffer(part, np.uint8)
             for part in np.split(np.frombuffer(body, np.uint8), np.cumsum(sizes)[:-1])]
    bits = np.unpackbits(parts[0].reshape(rows, -1), axis=1).view(np.bool_)
    on = bits[:, :columns]
    if bits[:, columns:].any() or np.count_nonzero(on) != n:
        raise ValueError("support")
    z = _summed(_long(parts[1], parts[4]), on, lambda values: values)
    if n and np.abs(z).max() > _REACH:
        raise ValueError("too far")
    colors = np.stack([_bytes(part, on) for part in parts[2].reshape(3, n)], axis=1)
    sigma = low * (high / low) ** (_bytes(parts[3], on) / 255)
    cells = np.argwhere(on)
    unit, step = float(header["unit_mm"]), float(header["step_mm"])
    points = np.stack([header["left_mm"] + cells[:, 1] * step,
                       header["top_mm"] + cells[:, 0] * step, z * unit], axis=1)
    steps = _long(parts[5], parts[7]).reshape(3, seeds)
    seed_colors = np.cumsum(parts[6].reshape(3, seeds), axis=1, dtype=np.uint8).T
    return FaceGrid(points, colors, sigma, cells, np.cumsum(steps, axis=1).T * unit, seed_colors,
                    header)


def _whole(header: dict[str, Any], name: str, low: int, high: int) -> int:
    value = header.get(name)
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"{name}: {value!r}")
    return value


def _long(short: NDArray[np.uint8], long: NDArray[np.uint8]) -> NDArray[np.int64]:
    folded = short.astype(np.int64)
    at = np.flatnonzero(short == 255)
    if len(at) != len(long) // 4:
        raise ValueError("long residuals of another number than the header says")
    folded[at] = long.view("<u4")
    return (folded >> 1) ^ -(folded & 1)


def _bytes(residuals: NDArray[np.uint8], on: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return _summed(residuals.astype(np.int64), on, lambda values: values & 255).astype(np.uint8)


def _summed(residuals: NDArray[np.int64], on: NDArray[np.bool_],
            wrapped: Callable[[NDArray[np.int64]], NDArray[np.int64]]) -> NDArray[np.int64]:
    """Undo the prediction, row by row: within a run of points it is a running sum."""
    rows, columns = on.shape
    grid = np.zeros((rows + 1, columns + 1), np.int64)
    known = np.pad(on, ((1, 0), (1, 0)))
    done = 0
    for row in range(1, rows + 1):
        at = np.flatnonzero(known[row])
        if not len(at):
            continue
        above, corner = grid[row - 1, at], grid[row - 1, at - 1]
        follows = known[row, at - 1]
        plane = follows & known[row - 1, at] & known[row - 1, at - 1]
        grown = residuals[done:done + len(at)] + np.where(
            plane, above - corner, np.where(follows, 0, above))
        total = np.cumsum(grown)
        starts = np.flatnonzero(~follows)
        before = (total - grown)[starts]
        grid[row, at] = wrapped(total - before[np.cumsum(~follows) - 1])
        done += len(at)
    return grid[1:, 1:][on]
