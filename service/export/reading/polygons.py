"""What several formats need: polygons to triangles, colours to bytes, corners to points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["fan", "joined", "to_bytes"]


def fan(polygons: "Sequence[NDArray[Any]] | NDArray[Any]") -> NDArray[np.int64]:
    """Give the triangles of polygons, from the first corner of each; lines and points are none.

    Parameters
    ----------
    polygons : (p, k), or rows of different lengths; whole numbers, of any dtype

    Returns
    -------
    (t, 3) int64
    """
    if isinstance(polygons, np.ndarray):
        corners = _whole(polygons)
        if corners.ndim != 2:
            raise ValueError("a face is no list of points")
        if corners.shape[1] < 3:
            return np.empty((0, 3), np.int64)
        return np.concatenate([corners[:, [0, k, k + 1]] for k in range(1, corners.shape[1] - 1)])
    by_length: dict[int, list[NDArray[Any]]] = {}
    for row in polygons:
        by_length.setdefault(len(row), []).append(row)
    parts = [fan(_whole(np.array(rows))) for length, rows in by_length.items() if length > 2]
    return np.concatenate(parts) if parts else np.empty((0, 3), np.int64)


def _whole(numbers: NDArray[Any]) -> NDArray[np.int64]:
    """Give numbers of points as integers; ValueError where one is none."""
    if numbers.dtype.kind == "f":
        if not (np.isfinite(numbers).all() and (np.abs(numbers) < 2**53).all()
                and (numbers == np.trunc(numbers)).all()):
            raise ValueError("a face names no whole number of a point")
    elif numbers.dtype.kind not in "iu":
        raise ValueError("a face names no number of a point")
    return numbers.astype(np.int64)


def to_bytes(colors: NDArray[Any]) -> NDArray[np.uint8]:
    """Give colours as 0-255: floats from 0-1, 16 bits by their upper half, others as they are.

    Colours read from text are floats, too: where one is above 1 all are 0-255.
    """
    if colors.dtype.kind == "f":
        top = np.nanmax(colors, initial=0.0)
        scaled = np.nan_to_num(colors, nan=0.0, posinf=0.0, neginf=0.0) * (255 if top <= 1 else 1)
        return np.asarray(np.clip(np.rint(scaled), 0, 255), np.uint8)
    if colors.dtype.itemsize == 2 and colors.dtype.kind == "u":
        return np.asarray(colors >> 8, np.uint8)
    return np.asarray(np.clip(colors, 0, 255), np.uint8)


def joined(corners: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Make one point of the corners of triangles that are in exactly one place.

    Parameters
    ----------
    corners : (t, 3, 3)

    Returns
    -------
    points : (n, 3)
    triangles : (t, 3) int64
    """
    flat = corners.reshape(-1, 3) + np.float32(0)  # of -0 makes 0
    order = np.lexsort(flat.T)
    ordered = flat[order]
    first = np.ones(len(flat), np.bool_)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.empty(len(flat), np.int64)
    number[order] = np.cumsum(first) - 1
    return ordered[first], number.reshape(-1, 3)
