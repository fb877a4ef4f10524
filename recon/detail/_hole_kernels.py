"""The surface inside holes that bends least, compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["interpolate_filled", "minimize_bending"]

# So often it is found, each time with the slopes of the one before.
_TIMES = 2
# Holds what neither seeds nor neighbours tell.
_RIDGE = 1e-4
# Second differences along rows, along columns, and mixed, which count twice.
_TAPS = np.array([[1.0, -2.0, 1.0, 0.0], [1.0, -2.0, 1.0, 0.0], [1.0, -1.0, -1.0, 1.0]])
_WEIGHTS = np.array([1.0, 1.0, 2.0])
# What four points are to a cell, a quarter of its side apart: the first of four cells for each of
# them, and their weights (cubic convolution).
_FIRST = np.array([-2, -2, -1, -1])
_CUBIC = np.array([[-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3,
                    t + 4 * t**2 - 3 * t**3, -t**2 + t**3]
                   for t in (0.625, 0.875, 0.125, 0.375)], np.float32) / 2


@compiled
def minimize_bending(
    counts: NDArray[np.float32], sums: NDArray[np.float32], base: NDArray[np.float32],
    added: NDArray[np.float32], labels: NDArray[np.int32], boxes: NDArray[np.int32],
    inside: NDArray[np.bool_], smoothing: float, step: float,
) -> None:
    """Find what is to be added to a height in holes; where no hole is, it stays.

    All are (rows, columns), of cells; no hole reaches within two cells of their outer ones.

    counts, sums : the seeds in each cell, and the sum of what they are off the height, mm
    base : the height, mm
    added : what is added to it, mm; changed where a hole is
    labels : the number of each hole, 1 and so on; 0 elsewhere
    boxes : (holes + 1, 5), left, top, width, height of each number's cells, and how many they are
    inside : where there is a surface
    smoothing : of the bending against the seeds' squares, mm^2 over mm^2
    step : from cell to cell, mm
    """
    index = np.full(labels.shape, -1, np.int32)
    for hole in range(1, len(boxes)):
        left, top, width, height, size = boxes[hole]
        rows, columns = np.empty(size, np.int32), np.empty(size, np.int32)
        # One after the other along the shorter side, so that neighbours' numbers are close.
        number = 0
        for i in range(width * height):
            r = top + (i % height if height < width else i // width)
            c = left + (i // height if height < width else i % width)
            if labels[r, c] == hole:
                index[r, c] = number
                rows[number], columns[number] = r, c
                number += 1
        band = 0
        for i in range(size):
            for down, right in ((2, 0), (0, 2), (1, 1), (1, -1), (1, 0), (0, 1)):
                other = index[rows[i] + down, columns[i] + right]
                if other >= 0:
                    band = max(band, abs(other - i))
        for _ in range(_TIMES):
            A, b = np.zeros((size, band + 1)), np.empty(size)
            for i in range(size):
                r, c = rows[i], columns[i]
                A[i, band] = counts[r, c] + _RIDGE
                b[i] = sums[r, c] + _RIDGE * added[r, c]
            _add_bending(A, b, index, base, added, inside, boxes[hole], smoothing, step)
            _solve(A, b)
            for i in range(size):
                added[rows[i], columns[i]] = b[i]
        for i in range(size):
            index[rows[i], columns[i]] = -1


@compiled
def _add_bending(
    A: NDArray[np.float64], b: NDArray[np.float64], index: NDArray[np.int32],
    base: NDArray[np.float32], added: NDArray[np.float32], inside: NDArray[np.bool_],
    box: NDArray[np.int32], smoothing: float, step: float,
) -> None:
    """Add the squares of all second differences in a hole to the normal equations.

    index : the number of each unknown, negative where what is added is given
    """
    left, top, width, height, _ = box
    band = A.shape[1] - 1
    ids = np.empty(4, np.int32)
    for r in range(top - 1, top + height + 1):
        for c in range(left - 1, left + width + 1):
            across = (base[r, c + 1] + added[r, c + 1]
                      - base[r, c - 1] - added[r, c - 1]) / (2 * step)
            down = (base[r + 1, c] + added[r + 1, c]
                    - base[r - 1, c] - added[r - 1, c]) / (2 * step)
            squared = 1 + across * across + down * down
            weight = smoothing / (squared * squared * math.sqrt(squared))
            for way in range(3):
                taps = 4 if way == 2 else 3
                known, most, constant = True, -1, 0.0
                for k in range(taps):
                    y = r + (k >> 1 if way == 2 else (k - 1) * way)
                    x = c + (k & 1 if way == 2 else (k - 1) * (1 - way))
                    known &= inside[y, x]
                    ids[k] = index[y, x]
                    most = max(most, ids[k])
                    constant += _TAPS[way, k] * (
                        base[y, x] + (np.float32(0) if ids[k] >= 0 else added[y, x]))
                if not known or most < 0:
                    continue
                for j in range(taps):
                    row = ids[j]
                    if row < 0:
                        continue
                    part = _WEIGHTS[way] * weight * _TAPS[way, j]
                    b[row] -= part * constant
                    for k in range(taps):
                        if 0 <= ids[k] <= row:
                            A[row, band + ids[k] - row] += part * _TAPS[way, k]


@compiled
def _solve(A: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    """Solve by Cholesky; both are written over, `b` by the solution.

    A : (n, band + 1), the lower half of a matrix, its diagonal last
    """
    n, band = len(A), A.shape[1] - 1
    for i in range(n):
        first = max(0, i - band)
        for j in range(first, i + 1):
            begin = max(first, j - band)
            one, other = A[i, band + begin - i:band + j - i], A[j, band + begin - j:band]
            total = 0.0
            for k in range(len(other)):
                total += one[k] * other[k]
            if j < i:
                A[i, band + j - i] = (A[i, band + j - i] - total) / A[j, band]
            else:
                A[i, band] = math.sqrt(A[i, band] - total)
        total = 0.0
        for j in range(first, i):
            total += A[i, band + j - i] * b[j]
        b[i] = (b[i] - total) / A[i, band]
    for i in range(n - 1, -1, -1):
        b[i] /= A[i, band]
        for j in range(max(0, i - band), i):
            b[j] -= A[i, band + j - i] * b[i]


@compiled
def interpolate_filled(
    added: NDArray[np.float32], labels: NDArray[np.int32], share: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Give at four times as many points what cells say, times a share, and the share itself.

    added, labels : (rows, columns), of cells, as of `minimize_bending`
    share : four times as many points each way, or up to three fewer

    Both are zero where there is no hole.
    """
    filled, hole = np.zeros_like(share), np.zeros_like(share)
    for r in range(2, labels.shape[0] - 2):
        for c in range(2, labels.shape[1] - 2):
            if labels[r, c] == 0:
                continue
            for down in range(min(4, share.shape[0] - 4 * r)):
                for right in range(min(4, share.shape[1] - 4 * c)):
                    i, j = 4 * r + down, 4 * c + right
                    part = share[i, j]
                    if part == 0:
                        continue
                    value = np.float32(0)
                    for y in range(4):
                        along = np.float32(0)
                        for x in range(4):
                            along += _CUBIC[right, x] * added[r + _FIRST[down] + y,
                                                             c + _FIRST[right] + x]
                        value += _CUBIC[down, y] * along
                    filled[i, j] = part * value
                    hole[i, j] = part
    return filled, hole
