"""Sums of Gaussians over scattered points, by way of a few points in each cell of a grid.

Within a cell, a Gaussian is so smooth that its values at `_ORDER` Chebyshev points across and as
many down tell it everywhere to 1e-6 (Lagrange interpolation). So each scattered weight is shared
out among those points of its cell, once; after that all sums are products of thin matrices.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["Charges", "gaussians"]

_ORDER = 8
_CELL = 1.0
_NEGLIGIBLE = 1e-7
_AT = np.cos(np.pi * (np.arange(_ORDER) + 0.5) / _ORDER)
# Row k: what each point's Lagrange polynomial has before t^k, for t from -1 to 1 in the cell.
_LAGRANGE = np.linalg.inv(np.vander(_AT, increasing=True)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Charges:
    """Scattered weights, shared out among the points of a grid.

    Attributes
    ----------
    x, y : (nx,), (ny,) float64, where the grid's points are
    shares : (k, ny, nx) float64, k kinds of weight
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    shares: NDArray[np.float64]

    @classmethod
    def of(
        cls, x: NDArray[np.float64], y: NDArray[np.float64], weights: NDArray[np.float64]
    ) -> "Charges":
        """Share out weights, (n, k), at (x, y), (n,) each, for Gaussians with sharpness <= 1."""
        x_low, y_low = float(x.min()), float(y.min())
        columns, rows = (int(np.ptp(one) / _CELL) + 1 for one in (x, y))
        shares = _share_out((x - x_low) / _CELL, (y - y_low) / _CELL, weights, rows, columns,
                            _LAGRANGE)
        return cls(_points(x_low, columns), _points(y_low, rows), shares.astype(np.float64))


def gaussians(
    centers: NDArray[np.float64], points: NDArray[np.float64], sharpness: float
) -> NDArray[np.float64]:
    """exp(-sharpness (center - point)^2), 0 where negligible: (k,), (n,) -> (k, n)."""
    gap = (centers[:, None] - points).astype(np.float32)
    values: NDArray[np.float32] = np.exp(-np.float32(sharpness) * gap * gap)
    values[values < _NEGLIGIBLE] = 0
    # The products are taken in double precision: what BLAS rounds otherwise on more threads is
    # then lost when the result is rounded to single.
    return values.astype(np.float64)


def _points(low: float, cells: int) -> NDArray[np.float64]:
    points: NDArray[np.float64] = (
        low + _CELL * (np.arange(cells)[:, None] + (_AT + 1) / 2)).ravel()
    return points


@compiled
def _polynomials(t: float, lagrange: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """out[a] = the a-th Lagrange polynomial at t."""
    at = np.float32(t)
    for a in range(_ORDER):
        out[a] = lagrange[_ORDER - 1, a]
    for k in range(_ORDER - 2, -1, -1):
        for a in range(_ORDER):
            out[a] = out[a] * at + lagrange[k, a]


@compiled
def _share_out(
    x: NDArray[np.float64], y: NDArray[np.float64], weights: NDArray[np.float64],
    rows: int, columns: int, lagrange: NDArray[np.float32],
) -> NDArray[np.float32]:
    """x, y : in cells; gives (k, rows order, columns order)."""
    kinds = weights.shape[1]
    width = columns * _ORDER
    out = np.zeros(kinds * rows * _ORDER * width, np.float32)
    across, down = np.empty(_ORDER, np.float32), np.empty(_ORDER, np.float32)
    for i in range(len(x)):
        column, row = min(int(x[i]), columns - 1), min(int(y[i]), rows - 1)
        _polynomials(2 * (x[i] - column) - 1, lagrange, across)
        _polynomials(2 * (y[i] - row) - 1, lagrange, down)
        for kind in range(kinds):
            weight = np.float32(weights[i, kind])
            first = ((kind * rows + row) * width + column) * _ORDER
            for b in range(_ORDER):
                factor = weight * down[b]
                line = out[first + b * width:first + b * width + _ORDER]
                for a in range(_ORDER):
                    line[a] += factor * across[a]
    return out.reshape(kinds, rows * _ORDER, width)
