"""Slopes of a surface on a grid, and what its detail is weighed by, compiled."""

import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.numerics.jit import compiled

_1 = np.uint64(1)


@compiled
def with_slopes(heights: Floats, step: float) -> Floats:
    """Give heights, dz/dx and dz/dy, (3, rows, columns).

    By central differences; one-sided, of half the size, at the edge.

    heights : (rows, columns), at least 2 each, mm; step : mm
    """
    rows, columns = heights.shape
    out = np.empty((3, rows, columns), np.float32)
    half = np.float32(0.5 / step)
    last = np.uint64(columns - 1)
    for row in range(rows):
        line = heights[row]
        above, below = heights[max(row - 1, 0)], heights[min(row + 1, rows - 1)]
        same, along_x, along_y = out[0, row], out[1, row], out[2, row]
        for j in range(np.uint64(columns)):  # `out[0] = heights` takes a second to compile
            same[j] = line[j]
        for j in range(np.uint64(columns)):
            along_y[j] = half * (below[j] - above[j])
        for j in range(_1, last):
            along_x[j] = half * (line[j + _1] - line[j - _1])
        along_x[0] = half * (line[1] - line[0])
        along_x[last] = half * (line[last] - line[last - _1])
    return out


@compiled
def normalize_sums(
    weight: Floats, sums: Floats, fading: float, full: float
) -> tuple[Floats, Floats]:
    """Divide sums by their weight, in place; means fade where the weight is near `fading`.

    weight, sums : (rows, columns)

    Gives the weight over `full`, clipped to 0-1, and the smoothstep of what it lacks.
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
def blend_toward(detail: Floats, broad: Floats, rim_weight: Floats, missing: Floats) -> None:
    """Blend detail in place toward a broad average, by the larger of two weights, 0-1.

    All are (rows, columns).
    """
    for i in range(detail.shape[0]):
        own, other, near, lacking = detail[i], broad[i], rim_weight[i], missing[i]
        for j in range(np.uint64(len(own))):
            own[j] += max(near[j], lacking[j]) * (other[j] - own[j])


@compiled
def mirror_planes(
    heights: Floats, detail: Floats, seeded: Floats, inner: Floats, step: float
) -> Floats:
    """Give the planes of a `HeightField`, (rows, columns, 5), at every second point.

    heights, detail, seeded : (2 rows, 2 columns) or one less; inner : (rows, columns), weight
    step : of the result, mm
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
