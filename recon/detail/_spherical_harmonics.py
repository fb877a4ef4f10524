"""Lighting by spherical harmonics of the surface's normals, compiled.

Nine terms, up to order two, hold 98 % of what any distant light does to a convex matt surface:
Basri and Jacobs, 2003, doi:10.1109/TPAMI.2003.1177153; Ramamoorthi and Hanrahan, 2001,
doi:10.1364/JOSAA.18.002448.
"""

import numpy as np

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

_TERMS = 9
"""Harmonics up to order two."""
_MIN_SAMPLES = 50
"""Fewer samples tell no lighting."""
_DARK = 0.3
"""Samples below this part of the median brightness are hair: no part of the first fit."""
_SCALE = 0.2
"""Scale of the refits' robust weights, in medians of the brightness: there a sample counts 1/4."""
_REFITS = 2
"""Refits with weights by the residuals of the fit before."""
_RIDGE = 1e-4
"""Ridge for each sample, against harmonics that the face's normals do not tell apart."""


@compiled
def sample_harmonics(
    brightness: Floats, weight: Floats, dz_dx: Floats, dz_dy: Floats, every: int
) -> tuple[Doubles, Doubles]:
    """Give the real harmonics of the unit normals without their constants, and the brightness.

    Of every so many points each way whose weight is above a half: (9, n) and (n,).

    brightness, weight, dz_dx, dz_dy : (rows, columns)
    """
    rows, columns = weight.shape
    most = (rows // every + 1) * (columns // every + 1)
    basis, samples = np.empty((_TERMS, most)), np.empty(most)
    count = 0
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            if weight[i, j] <= 0.5:
                continue
            p, q = dz_dx[i, j], dz_dy[i, j]
            z = 1 / np.sqrt(1 + p * p + q * q)
            x, y = p * z, q * z
            basis[0, count], basis[1, count] = 1, x
            basis[2, count], basis[3, count] = y, z
            basis[4, count], basis[5, count], basis[6, count] = x * x, x * y, y * y
            basis[7, count], basis[8, count] = x * z, y * z
            samples[count] = brightness[i, j]
            count += 1
    return np.ascontiguousarray(basis[:, :count]), samples[:count].copy()


@compiled
def fit_lighting(basis: Doubles, samples: Doubles) -> tuple[Floats, float]:
    """Fit harmonics to brightness by robust least squares: weights of Geman and McClure, 1987.

    basis, samples : (9, n), (n,), of `sample_harmonics`

    Gives the coefficients, (9,), and the median brightness; 0 where there is too little of it.
    """
    lighting = np.zeros(_TERMS)
    median = np.median(samples) if len(samples) >= _MIN_SAMPLES else 0.0
    if median <= 0:
        return lighting.astype(np.float32), 0.0
    weights = np.empty(len(samples))
    for i in range(len(samples)):
        weights[i] = 1.0 if samples[i] > _DARK * median else 0.0
    for fit in range(1 + _REFITS):
        if fit > 0:
            for i in range(len(samples)):  # `weights[:] = samples` takes a second to compile
                weights[i] = samples[i]
            for j in range(_TERMS):
                term, part = basis[j], lighting[j]
                for i in range(len(samples)):
                    weights[i] -= part * term[i]
            per_scale = 1 / (_SCALE * median)
            for i in range(len(samples)):
                off = weights[i] * per_scale
                near = 1 / (1 + off * off)
                weights[i] = near * near
        lighting = _weighted_least_squares(basis, samples, weights)
    return lighting.astype(np.float32), median


@compiled
def _weighted_least_squares(basis: Doubles, samples: Doubles, weights: Doubles) -> Doubles:
    """Solve the normal equations, with a ridge; (9,)."""
    count = len(samples)
    matrix, right = np.zeros((_TERMS, _TERMS)), np.zeros(_TERMS)
    weighted = np.empty(count)
    for j in range(_TERMS):
        one = basis[j]
        for i in range(count):
            weighted[i] = weights[i] * one[i]
        for k in range(j + 1):
            other, total = basis[k], 0.0
            for i in range(count):
                total += weighted[i] * other[i]
            matrix[j, k] = matrix[k, j] = total
        total = 0.0
        for i in range(count):
            total += weighted[i] * samples[i]
        right[j] = total
        matrix[j, j] += _RIDGE * count
    return solve_small(matrix, right)
