"""Compiled loops that pack a dense cloud."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled_exactly


@compiled_exactly  # another thread computes the next face meanwhile
def pack(
    points: NDArray[np.float32], normals: NDArray[np.float32], cells: NDArray[np.int32],
    rows: int, columns: int, unit: float,
) -> tuple[int, NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32],
           NDArray[np.float32], NDArray[np.int16]]:
    """Return how many points could be packed, then support, xs, ys, zs and normals.

    Packing stops at a point that is not at its cell, is not behind its predecessor in the grid's
    order, or whose normal points away from the camera.
    """
    n = len(points)
    support = np.zeros((rows, (columns + 7) // 8), np.uint8)
    xs, ys = np.zeros(columns, np.float32), np.zeros(rows, np.float32)
    known_x, known_y = np.zeros(columns, np.bool_), np.zeros(rows, np.bool_)
    zs, tilts = np.empty(n, np.float32), np.empty((n, 2), np.int16)
    scale = np.float32(unit)
    previous = np.int64(-1)
    for i in range(n):
        row, column = np.int64(cells[i, 0]), np.int64(cells[i, 1])
        cell = row * columns + column
        x, y = points[i, 0], points[i, 1]
        if not known_x[column]:
            known_x[column], xs[column] = True, x
        if not known_y[row]:
            known_y[row], ys[row] = True, y
        if cell <= previous or xs[column] != x or ys[row] != y or normals[i, 2] > 0:
            return i, support, xs, ys, zs, tilts
        previous = cell
        support[row, column >> 3] |= np.uint8(128 >> (column & 7))
    for i in range(n):
        zs[i] = points[i, 2]
    for i in range(n):
        for j in range(2):
            tilts[i, j] = np.int16(np.rint(normals[i, j] * scale))
    return n, support, xs, ys, zs, tilts


@compiled_exactly
def to_float16_bits(bits: NDArray[np.uint32]) -> NDArray[np.uint16]:
    """Round float32 to float16, both as their bits; 25 times as fast as NumPy.

    For positive numbers alone that are normalised in both.
    """
    out = np.empty(len(bits), np.uint16)
    for i in range(len(bits)):
        odd = (bits[i] >> np.uint32(13)) & np.uint32(1)
        out[i] = np.uint16((bits[i] - np.uint32(112 << 23) + np.uint32(0xFFF) + odd)
                           >> np.uint32(13))
    return out
