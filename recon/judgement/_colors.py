"""Whether colour lies where the relief has eyes, brows, nose and mouth."""

import math
from functools import cache

import numpy as np

from denseface.recon.arrays import Bytes, Doubles, Floats
from denseface.recon.judgement._mould_kernels import in_mould
from denseface.recon.judgement._placing import mean_face, mean_face_data
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["LEAST_COLOR_LIKENESS", "color_likeness"]

LEAST_COLOR_LIKENESS = 0.08
"""Less is doubted. Right colours have 0.19 and more on scans of heads, 0.11 on the procedural one;
those of another place about 0: docs/decisions/0054-a-face-by-its-relief.md."""

_CELL_MM = 5.0
_HALF_WIDTH_MM, _HIGHEST_MM, _LOWEST_MM = 70.0, -75.0, 65.0
"""The part of the mean face that is compared: hair and neck lie beyond."""
_MOST = 3000
"""Points are enough: some in each cell."""
_DARK = 8.0
"""Grey levels that are added before the logarithm: noise in the dark tells nothing."""
_FEWEST = 60
"""Cells, with fewer of which nothing is said."""
_RADIUS_MM = 85.0
"""Turns angles into mm, as for the relief."""


def color_likeness(placement: Doubles, points: Floats, colors: Bytes) -> float | None:
    """Correlate the brightness of a face with the mean face's, where that was laid on it.

    What a quadric leaves of either's logarithm is compared: so neither skin nor the lamp's side
    tell much, but that eyes, brows, nostrils and mouth are darker than what is around them.

    Parameters
    ----------
    placement : (13,), of the mean face on the points
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB

    Returns
    -------
    from -1 to 1; None where too little of a face is there
    """
    found = _correlation(placement, points, colors, max(1, -(-len(points) // _MOST)),
                         mean_face().axis_z, _mean_brightness())
    return None if found < -1 else float(found)


@compiled
def _correlation(
    placement: Doubles, points: Floats, colors: Bytes, every: int, axis_z: float, expected: Doubles
) -> float:
    """Correlate, by every so many of the points, as `color_likeness` says; -2 where there are few.

    axis_z : of the mean face; expected : (rows, columns), logarithms of its cells' brightness
    """
    rows, columns = expected.shape
    sums, counts = np.zeros((rows, columns)), np.zeros((rows, columns), np.int32)
    for i in range(0, len(points), every):
        x, y, z = in_mould(points[i], placement)
        column = math.floor((math.atan2(x, axis_z - z) * _RADIUS_MM + _HALF_WIDTH_MM) / _CELL_MM
                            + 0.5)
        row = math.floor((y - _HIGHEST_MM) / _CELL_MM + 0.5)
        if 0 <= row < rows and 0 <= column < columns:
            gray = (float(colors[i, 0]) + float(colors[i, 1]) + float(colors[i, 2])) / 3
            sums[row, column] += math.log(gray + _DARK)
            counts[row, column] += 1
    matrix, right, term = np.zeros((6, 6)), np.zeros((2, 6)), np.ones(6)
    own_square = mean_square = both = 0.0
    seen = 0
    for row in range(rows):
        for column in range(columns):
            if counts[row, column] == 0:
                continue
            seen += 1
            own, mean = sums[row, column] / counts[row, column], expected[row, column]
            u, v = _CELL_MM / _RADIUS_MM * column, _CELL_MM / _RADIUS_MM * row
            term[1], term[2], term[3], term[4], term[5] = u, v, u * u, u * v, v * v
            own_square += own * own
            mean_square += mean * mean
            both += own * mean
            for j in range(6):
                right[0, j] += term[j] * own
                right[1, j] += term[j] * mean
                for k in range(6):
                    matrix[j, k] += term[j] * term[k]
    if seen < _FEWEST:
        return -2.0
    fit = solve_small(matrix.copy(), right[0].copy())
    mean_fit = solve_small(matrix.copy(), right[1].copy())
    for j in range(6):
        both -= right[0, j] * mean_fit[j]
        own_square -= right[0, j] * fit[j]
        mean_square -= right[1, j] * mean_fit[j]
    return both / max(math.sqrt(max(own_square, 0.0) * max(mean_square, 0.0)), 1e-9)


@cache
def _mean_brightness() -> Doubles:
    """Give the logarithm of the mean face's brightness in its cells, (heights, widths)."""
    data = mean_face_data()
    brightness, (angle, step, height, down, _) = data["brightness"], data["axes"]
    around = np.arange(-_HALF_WIDTH_MM, _HALF_WIDTH_MM + 1, _CELL_MM) / _RADIUS_MM
    columns = np.rint((np.degrees(around) - angle) / step).astype(np.intp)
    rows = np.arange(_HIGHEST_MM, _LOWEST_MM + 1, _CELL_MM)
    rows = np.rint((rows - height) / down).astype(np.intp)
    return np.asarray(brightness[np.ix_(rows, columns)], np.float64)
