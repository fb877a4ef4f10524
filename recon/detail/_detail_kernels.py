"""Slopes of a surface on a grid, and what else its detail is weighed by, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["blend_toward", "face_field", "shares", "slopes"]

_1 = np.uint64(1)


@compiled
def slopes(
    heights: NDArray[np.float32], step: float, across: NDArray[np.float32],
    down: NDArray[np.float32],
) -> None:
    """Set dz/dx and dz/dy of points at a distance, mm; all are (rows, columns), 2 each at least.

    From the neighbours on both sides; beyond the edge its own height goes on.
    """
    rows, columns = heights.shape
    half = np.float32(0.5 / step)
    last = np.uint64(columns - 1)
    for row in range(rows):
        line = heights[row]
        above, below = heights[max(row - 1, 0)], heights[min(row + 1, rows - 1)]
        out_across, out_down = across[row], down[row]
        for j in range(np.uint64(columns)):
            out_down[j] = half * (below[j] - above[j])
        for j in range(_1, last):
            out_across[j] = half * (line[j + _1] - line[j - _1])
        out_across[0] = half * (line[1] - line[0])
        out_across[last] = half * (line[last] - line[last - _1])


@compiled
def shares(
    weight: NDArray[np.float32], sums: NDArray[np.float32], fading: float, full: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Make sums means, which fade where the weight is not much more than `fading`.

    weight, sums : (rows, columns); the last changed

    Gives how much of `full` the weight is, 0-1, and how much is missing of that, smooth between.
    """
    seeded, missing = np.empty_like(weight), np.empty_like(weight)
    least, per_full = np.float32(fading), np.float32(1 / full)
    one, two, three = np.float32(1), np.float32(2), np.float32(3)
    for i in range(weight.shape[0]):
        own, total, known, lacking = weight[i], sums[i], seeded[i], missing[i]
        for j in range(np.uint64(len(own))):
            total[j] /= own[j] + least
        for j in range(np.uint64(len(own))):
            part = min(own[j] * per_full, one)
            known[j] = part
            rest = one - part
            lacking[j] = rest * (rest * (three - two * rest))
    return seeded, missing


@compiled
def blend_toward(
    detail: NDArray[np.float32], broad: NDArray[np.float32], nearness: NDArray[np.float32],
    missing: NDArray[np.float32],
) -> None:
    """Move detail toward a broad average, by how near the rim is or how much is missing.

    All are (rows, columns), `detail` is changed.
    """
    for i in range(detail.shape[0]):
        own, other, near, lacking = detail[i], broad[i], nearness[i], missing[i]
        for j in range(np.uint64(len(own))):
            own[j] += max(near[j], lacking[j]) * (other[j] - own[j])


@compiled
def face_field(
    heights: NDArray[np.float32], detail: NDArray[np.float32], seeded: NDArray[np.float32],
    inner: NDArray[np.float32], step: float,
) -> NDArray[np.float32]:
    """Give the field that a face is mirrored in, (rows, columns, 5); see `symmetry_correction`.

    heights, detail, seeded : (2 rows, 2 columns), of which every second point counts
    inner : (rows, columns), weight as a mirror image
    step : from point to point of the field, mm
    """
    rows, columns = inner.shape
    out = np.empty((rows, columns, 5), np.float32)
    half = np.float32(0.5 / step)
    for i in range(rows):
        above, below = 2 * max(i - 1, 0), 2 * min(i + 1, rows - 1)
        for j in range(columns):
            left, right = 2 * max(j - 1, 0), 2 * min(j + 1, columns - 1)
            dx = half * (heights[2 * i, right] - heights[2 * i, left])
            dy = half * (heights[below, 2 * j] - heights[above, 2 * j])
            facing = np.float32(1) / np.sqrt(dx * dx + dy * dy + np.float32(1))
            out[i, j, 0], out[i, j, 1] = heights[2 * i, 2 * j], facing
            out[i, j, 2], out[i, j, 3] = inner[i, j], detail[2 * i, 2 * j] * facing
            out[i, j, 4] = seeded[2 * i, 2 * j]
    return out
