"""Local means of uncertain pixels: normalized convolution, at half the resolution.

Knutsson and Westin, 1993, doi:10.1109/CVPR.1993.341081: blurred products of weight and value over
the blurred weight.
"""

import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.numerics.filters import blurred
from denseface.recon.numerics.jit import compiled

__all__ = ["normalized", "normalized_convolution"]

_LEAST_WEIGHT = np.float32(1e-6)
"""Weights are divided by as if they were at least this."""
_QUARTER = np.float32(0.25)


def normalized_convolution(weight: Floats, sigma: float, *values: Floats) -> list[Floats]:
    """Average images under a Gaussian, (rows, columns) each to half of that, rounded up.

    Parameters
    ----------
    weight : (rows, columns) float32, of each pixel
    sigma : the Gaussian's standard deviation, pixels of the means
    values : (rows, columns) float32
    """
    return list(normalized(blurred(_downsampled_products(weight, values), sigma)))


@compiled
def _downsampled_products(weight: Floats, values: tuple[Floats, ...]) -> Floats:
    """Average a weight, and its product with each value, over each four pixels.

    weight, values : (rows, columns) each; beyond the edge the weight is zero

    Returns (rows, columns, 1 + values), half of the rows and columns, rounded up.
    """
    rows, columns = weight.shape
    out = np.zeros(((rows + 1) // 2, (columns + 1) // 2, 1 + len(values)), np.float32)
    for i in range(rows):
        line, given = out[i // 2], weight[i]
        for j in range(np.uint64(columns)):
            line[j >> np.uint64(1), 0] += _QUARTER * given[j]
    for k in range(len(values)):
        value = values[k]
        for i in range(rows):
            line, given, shown = out[i // 2], weight[i], value[i]
            for j in range(np.uint64(columns)):
                line[j >> np.uint64(1), k + 1] += _QUARTER * given[j] * shown[j]
    return out


@compiled
def normalized(planes: Floats) -> Floats:
    """Divide all planes but the first by it: (rows, columns, 1 + k) to (k, rows, columns)."""
    rows, columns, count = planes.shape
    out = np.empty((count - 1, rows, columns), np.float32)
    for k in range(1, count):
        for i in range(rows):
            for j in range(columns):
                out[k - 1, i, j] = planes[i, j, k] / max(planes[i, j, 0], _LEAST_WEIGHT)
    return out
