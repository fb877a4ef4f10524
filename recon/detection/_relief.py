"""How far what a box shows bulges toward the camera; the fits are compiled."""

import numpy as np

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

_HEAD_MM = 120.0
"""Depths nearer or farther than the middle by more than this, mm, are not part of the head."""
_MIN_DEPTHS = 12
"""Fewer depths do not tell a bulge from noise."""
_IN_FRONT_MM = 20.0
"""Depths nearer than the fit by more than this, mm, are left out of the next: a hand before the
chin would hide the bulge."""
_FITS = 3
"""Number of fits, the largest bulge of which counts."""
_SAMPLES = 5
"""Samples from the middle of a cell's surroundings to each side, at most."""


def bulge_mm(depths: Doubles, depth_mm: float) -> float:
    """Fit z = a + b u + c v + d (u^2 + v^2) to a box's depths, and give d at the box's sides.

    A wall, a cupboard or a photograph, however slanted, has none; a face about 30 mm.

    Parameters
    ----------
    depths : (n, 3), u and v from -1 to 1 in the box, and z, mm
    depth_mm : median z in the middle of the box

    Returns
    -------
    mm, positive where the middle is nearer than the sides; inf where depths are too few to tell
    """
    bulge, known = fit_bulge(depths, depth_mm)
    return float(bulge) if known else np.inf


@compiled
def fit_bulge(depths: Doubles, depth_mm: float) -> tuple[float, bool]:
    """Give `bulge_mm`, and whether there are enough depths to tell."""
    kept = np.ones(len(depths), np.bool_)
    fitted = np.zeros(4)
    best, last = -_HEAD_MM, 0
    for fit in range(_FITS):
        matrix, right, count = _normal_equations(depths, depth_mm, fitted, fit > 0, kept)
        if count < _MIN_DEPTHS or count == last:
            break
        last = count
        fitted = solve_small(matrix, right)
        best = max(best, fitted[3])
    return best, last > 0


@compiled
def _normal_equations(
    depths: Doubles, depth_mm: float, fitted: Doubles, trim: bool, kept: Bools
) -> tuple[Doubles, Doubles, int]:
    """Give the fit's equations over the kept depths, and their number.

    kept : (n,), cleared outside the unit circle, off the head and, where `trim`, in front of
        `fitted`
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
        # Written out: numba's np.dot imports scipy.linalg, a tenth of a second.
        there = fitted[0] + fitted[1] * u + fitted[2] * v + fitted[3] * squared
        if trim and z - there <= -_IN_FRONT_MM:
            kept[i] = False
            continue
        count += 1
        for row in range(4):
            right[row] += term[row] * z
            for column in range(4):
                matrix[row, column] += term[row] * term[column]
    return matrix, right, count


@compiled
def bulging_cells(nearest: Floats, allowed: Bools, half_at_1_mm: float, min_mm: float) -> Bools:
    """Give the allowed cells around which depth bulges by at least `min_mm`, or cannot tell.

    nearest : (rows, columns), mm, the nearest depth in each cell, or a very large number
    half_at_1_mm : from the middle of a box to its side, cells, at a distance of 1 mm
    """
    rows, columns = nearest.shape
    bulging = allowed.copy()
    depths = np.empty(((2 * _SAMPLES + 1) ** 2, 3))
    for i in range(rows):
        for j in range(columns):
            if not allowed[i, j]:
                continue
            half = half_at_1_mm / nearest[i, j]
            step = max(1, int(np.ceil(half / _SAMPLES)))
            samples = int(half / step)
            count = 0
            for dy in range(-samples, samples + 1):
                for dx in range(-samples, samples + 1):
                    row, column = i + dy * step, j + dx * step
                    if 0 <= row < rows and 0 <= column < columns:
                        depths[count, 0] = dx * step / half
                        depths[count, 1] = dy * step / half
                        depths[count, 2] = nearest[row, column]
                        count += 1
            bulge, known = fit_bulge(depths[:count], float(nearest[i, j]))
            bulging[i, j] = bulge >= min_mm or not known
    return bulging
