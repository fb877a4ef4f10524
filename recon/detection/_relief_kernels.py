"""The loops that fit a bulge to depths, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["curved_cells", "fitted_bulge"]

# What is this much nearer or farther than the middle is not part of the same head.
_HEAD_MM = 120.0
# Fewer depths do not tell a bulge from noise.
_LEAST_DEPTHS = 12
# A hand before the chin takes the bulge away: what is so far before all else is left out.
_BEFORE_MM = 20.0
_FITS = 3
# Of a cell's surroundings so many each way are enough.
_SAMPLES = 5


@compiled
def fitted_bulge(depths: NDArray[np.float64], depth_mm: float) -> tuple[float, bool]:
    """Give d of z = a + b u + c v + d (u^2 + v^2), mm, and whether depths are enough to tell.

    depths : (n, 3), u and v from -1 to 1, and z, mm
    depth_mm : z in the middle
    """
    kept = np.ones(len(depths), np.bool_)
    fitted = np.zeros(4)
    best, last = -_HEAD_MM, 0
    for fit in range(_FITS):
        matrix, right, count = _normal_equations(depths, depth_mm, fitted, fit > 0, kept)
        if count < _LEAST_DEPTHS or count == last:
            break
        last = count
        fitted = solve_small(matrix, right)
        best = max(best, fitted[3])
    return best, last > 0


@compiled
def _normal_equations(
    depths: NDArray[np.float64], depth_mm: float, fitted: NDArray[np.float64], trim: bool,
    kept: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Give the fit's equations over the kept depths, and their number.

    kept : (n,), lowered to the same head's in the unit circle, without what stands before `fitted`
    """
    matrix, right = np.zeros((4, 4)), np.zeros(4)
    term = np.ones(4)
    count = 0
    for i in range(len(depths)):
        u, v, z = depths[i, 0], depths[i, 1], depths[i, 2] - depth_mm
        squared = u * u + v * v
        if not kept[i] or squared >= 1 or abs(z) >= _HEAD_MM:
            kept[i] = False
            continue
        term[1], term[2], term[3] = u, v, squared
        if trim and z - np.dot(fitted, term) <= -_BEFORE_MM:
            kept[i] = False
            continue
        count += 1
        for row in range(4):
            right[row] += term[row] * z
            for column in range(4):
                matrix[row, column] += term[row] * term[column]
    return matrix, right, count


@compiled
def curved_cells(
    nearest: NDArray[np.float32], wanted: NDArray[np.bool_], half_at_1_mm: float, least_mm: float
) -> NDArray[np.bool_]:
    """Say around which of the wanted cells depth bulges by at least so much, or can not tell.

    nearest : (rows, columns), mm, the nearest depth in each cell, or a very large number
    half_at_1_mm : from the middle of a box to its side, cells, at a distance of 1 mm
    """
    rows, columns = nearest.shape
    curved = wanted.copy()
    depths = np.empty(((2 * _SAMPLES + 1) ** 2, 3))
    for i in range(rows):
        for j in range(columns):
            if not wanted[i, j]:
                continue
            half = half_at_1_mm / nearest[i, j]
            step = max(1, int(np.ceil(half / _SAMPLES)))
            samples = int(half / step)
            count = 0
            for down in range(-samples, samples + 1):
                for across in range(-samples, samples + 1):
                    row, column = i + down * step, j + across * step
                    if 0 <= row < rows and 0 <= column < columns:
                        depths[count, 0] = across * step / half
                        depths[count, 1] = down * step / half
                        depths[count, 2] = nearest[row, column]
                        count += 1
            bulge, known = fitted_bulge(depths[:count], float(nearest[i, j]))
            curved[i, j] = bulge >= least_mm or not known
    return curved
