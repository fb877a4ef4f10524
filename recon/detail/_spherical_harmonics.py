"""The light on a face, by spherical harmonics of its normals, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["fit_lighting", "sample_harmonics"]

Image = NDArray[np.float32]

_TERMS = 9
_LEAST_PLACES = 50
# What is this share of the median brightness or less is hair, at first; what is off the light by
# this share counts a quarter.
_DARK = 0.3
_OFF = 0.2
_REFITS = 2
_RIDGE = 1e-4


@compiled
def sample_harmonics(
    brightness: Image, weight: Image, across: Image, down: Image, every: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give what the light is a sum of, (9, n), and the brightness, (n,).

    Of every so many places each way whose weight is above a half: the real spherical harmonics up
    to order two of the unit normal, without their constants.

    across, down : (rows, columns), dz/dx and dz/dy
    """
    rows, columns = weight.shape
    most = (rows // every + 1) * (columns // every + 1)
    basis, seen = np.empty((_TERMS, most)), np.empty(most)
    count = 0
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            if weight[i, j] <= 0.5:
                continue
            p, q = across[i, j], down[i, j]
            z = 1 / np.sqrt(1 + p * p + q * q)
            x, y = p * z, q * z
            basis[0, count], basis[1, count] = 1, x
            basis[2, count], basis[3, count] = y, z
            basis[4, count], basis[5, count], basis[6, count] = x * x, x * y, y * y
            basis[7, count], basis[8, count] = x * z, y * z
            seen[count] = brightness[i, j]
            count += 1
    return np.ascontiguousarray(basis[:, :count]), seen[:count].copy()


@compiled
def fit_lighting(
    basis: NDArray[np.float64], seen: NDArray[np.float64]
) -> tuple[NDArray[np.float32], float]:
    """Fit the light to the brightness, as of `sample_harmonics`.

    Gives what each term counts, (9,), and the median brightness; 0 where there is too little.
    """
    light = np.zeros(_TERMS)
    median = np.median(seen) if len(seen) >= _LEAST_PLACES else 0.0
    if median <= 0:
        return light.astype(np.float32), 0.0
    weights = np.empty(len(seen))
    for i in range(len(seen)):
        weights[i] = 1.0 if seen[i] > _DARK * median else 0.0
    for fit in range(1 + _REFITS):
        if fit > 0:
            weights[:] = seen
            for j in range(_TERMS):
                term, part = basis[j], light[j]
                for i in range(len(seen)):
                    weights[i] -= part * term[i]
            per_off = 1 / (_OFF * median)
            for i in range(len(seen)):
                off = weights[i] * per_off
                near = 1 / (1 + off * off)
                weights[i] = near * near
        light = _fitted(basis, seen, weights)
    return light.astype(np.float32), median


@compiled
def _fitted(
    basis: NDArray[np.float64], seen: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solve the normal equations, with a ridge."""
    count = len(seen)
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
            total += weighted[i] * seen[i]
        right[j] = total
        matrix[j, j] += _RIDGE * count
    return solve_small(matrix, right)
