"""Images resampled on other grids, bilinear, compiled.

Along the rows first, once for each row of the image, then from row to row. Coordinates are
fractional rows, (m,), and columns, (k,), of the image: inside it and rising.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Floats
from denseface.recon.numerics.jit import compiled

__all__ = ["add_resampled", "column_positions", "exceeds", "multiply_resampled"]

_1 = np.uint64(1)
"""Unsigned: an index that might be negative costs a check at each access."""


@compiled
def add_resampled(image: Floats, coarse: Floats, rows: Floats, columns: Floats) -> None:
    """Add a resampled image to another, (m, k)."""
    left, part = column_positions(columns, coarse.shape[1])
    lines, known = np.empty((2, len(columns)), np.float32), -2
    for i in range(len(rows)):
        above = min(int(rows[i]), coarse.shape[0] - 2)
        if above != known:
            _read_rows(coarse, above, known, left, part, lines)
            known = above
        upper, lower, down = lines[above & 1], lines[1 - (above & 1)], rows[i] - np.float32(above)
        own = image[i]
        for j in range(len(columns)):
            own[j] += upper[j] + down * (lower[j] - upper[j])


@compiled
def exceeds(coarse: Floats, rows: Floats, columns: Floats, level: float) -> Bools:
    """Say where a resampled image is above a level, (m, k)."""
    found = np.empty((len(rows), len(columns)), np.bool_)
    left, part = column_positions(columns, coarse.shape[1])
    lines, known, least = np.empty((2, len(columns)), np.float32), -2, np.float32(level)
    for i in range(len(rows)):
        above = min(int(rows[i]), coarse.shape[0] - 2)
        if above != known:
            _read_rows(coarse, above, known, left, part, lines)
            known = above
        upper, lower, down = lines[above & 1], lines[1 - (above & 1)], rows[i] - np.float32(above)
        own = found[i]
        for j in range(len(columns)):
            own[j] = upper[j] + down * (lower[j] - upper[j]) > least
    return found


@compiled
def multiply_resampled(image: Floats, coarse: Floats, rows: Floats, columns: Floats) -> None:
    """Multiply an image, (m, k), by a resampled one."""
    left, part = column_positions(columns, coarse.shape[1])
    lines, known = np.empty((2, len(columns)), np.float32), -2
    for i in range(len(rows)):
        above = min(int(rows[i]), coarse.shape[0] - 2)
        if above != known:
            _read_rows(coarse, above, known, left, part, lines)
            known = above
        upper, lower, down = lines[above & 1], lines[1 - (above & 1)], rows[i] - np.float32(above)
        own = image[i]
        for j in range(len(columns)):
            own[j] *= upper[j] + down * (lower[j] - upper[j])


@compiled
def _read_rows(
    image: Floats, first: int, known: int, left: NDArray[np.uint32], part: Floats, lines: Floats
) -> None:
    """Read a row of an image and the next at some columns.

    known : the row that was read before, with its next
    lines : (2, k), the even row, then the odd one
    """
    for row in range(first if first != known + 1 else first + 1, first + 2):
        line, into = image[row], lines[row & 1]
        for j in range(np.uint64(len(left))):
            here = line[left[j]]
            into[j] = here + part[j] * (line[left[j] + _1] - here)


@compiled
def column_positions(columns: Floats, width: int) -> tuple[NDArray[np.uint32], Floats]:
    """Split columns into the pixel to the left, and how far each is from it."""
    left, part = np.empty(len(columns), np.uint32), np.empty(len(columns), np.float32)
    for j in range(len(columns)):
        left[j] = min(int(columns[j]), width - 2)
        part[j] = columns[j] - np.float32(left[j])
    return left, part
