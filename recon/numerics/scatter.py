"""Scattered points to pixels and back, compiled."""

import numpy as np

from denseface.recon.arrays import Bytes, Floats
from denseface.recon.numerics.jit import compiled

__all__ = ["BILINEAR_VARIANCE", "interpolate", "occupancy", "pixel_coordinates", "splat",
           "xy_bounds"]

_1 = np.uint64(1)
BILINEAR_VARIANCE = 1 / 6
"""Mean variance of the blur by bilinear weights, squared pixels."""


@compiled
def xy_bounds(points: Floats) -> tuple[float, float, float, float]:
    """Give the least and the largest x, the least and the largest y of (n, 3) points, n >= 1."""
    left = right = points[0, 0]
    top = bottom = points[0, 1]
    for i in range(len(points)):
        left, right = min(left, points[i, 0]), max(right, points[i, 0])
        top, bottom = min(top, points[i, 1]), max(bottom, points[i, 1])
    return left, right, top, bottom


@compiled
def occupancy(
    points: Floats, origin: tuple[float, float], step: float, rows: int, columns: int
) -> Bytes:
    """Set the pixel nearest to each point, (n, 3): (rows, columns), 0 or 1.

    origin, step : centre of pixel (0, 0), (x, y), and distance of pixels, mm; no point is farther
        than half a pixel outside of the image
    """
    image = np.zeros((rows, columns), np.uint8)
    per_step = 1 / step
    for i in range(len(points)):
        row = np.uint32((points[i, 1] - origin[1]) * per_step + 0.5)
        column = np.uint32((points[i, 0] - origin[0]) * per_step + 0.5)
        image[row, column] = 1
    return image


@compiled
def pixel_coordinates(points: Floats, origin: tuple[float, float], step: float) -> Floats:
    """Give the fractional (row, column) of each point, (n, 3) to (n, 2), at least 0.

    origin, step : as of `occupancy`
    """
    out = np.empty((len(points), 2), np.float32)
    for i in range(len(points)):
        out[i, 0] = max((points[i, 1] - origin[1]) / step, 0.0)
        out[i, 1] = max((points[i, 0] - origin[0]) / step, 0.0)
    return out


@compiled
def splat(columns: Floats, rows: Floats, values: Floats, counts: Floats, sums: Floats) -> None:
    """Add 1, and each value, to the four pixels around its coordinates, by bilinear weights.

    columns, rows : (n,), inside the images, not on their last row or column
    """
    flat, same, width = sums.ravel(), counts.ravel(), np.uint64(sums.shape[1])
    for i in range(len(values)):
        # Unsigned: an index that might be negative costs a check at each access.
        left, above = np.uint64(columns[i]), np.uint64(rows[i])
        right_part, low = columns[i] - np.float32(left), rows[i] - np.float32(above)
        value, at = values[i], above * width + left
        below, right = at + width, right_part * low
        same[at] += 1 - low - right_part + right
        same[at + _1] += right_part - right
        same[below] += low - right
        same[below + _1] += right
        flat[at] += value * (1 - low - right_part + right)
        flat[at + _1] += value * (right_part - right)
        flat[below] += value * (low - right)
        flat[below + _1] += value * right


@compiled
def interpolate(image: Floats, columns: Floats, rows: Floats) -> Floats:
    """Read an image at the coordinates of `splat`, bilinear: (n,)."""
    out = np.empty(len(columns), np.float32)
    for i in range(len(columns)):
        left, above = np.uint32(columns[i]), np.uint32(rows[i])
        right_part, lower_part = columns[i] - np.float32(left), rows[i] - np.float32(above)
        one, two = image[above, left], image[above + 1, left]
        upper = one + right_part * (image[above, left + 1] - one)
        lower = two + right_part * (image[above + 1, left + 1] - two)
        out[i] = upper + lower_part * (lower - upper)
    return out
