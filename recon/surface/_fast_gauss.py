"""Sums of Gaussians over scattered points, by way of a regular grid.

A fast Gauss transform (Greengard and Strain, 1991, doi:10.1137/0912004), by Gaussian gridding
(Greengard and Lee, 2004, doi:10.1137/S003614450343200X) instead of Hermite expansions. A Gaussian
is the product of narrower ones, summed over a regular grid of points s with step d:

    exp(-b (x - t)^2) = d sqrt((a + e) / pi) sum_s exp(-a (x - s)^2) exp(-e (s - t)^2),
    e = a b / (a - b),

to about 2 exp(-pi^2 / (d^2 (a + e))). So each source is spread by the sharper factor over the few
grid points around it, once; after that all sums, for any b up to the sharpest, are products of
thin matrices of the broader one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Doubles, Floats, Ints
from denseface.recon.numerics.jit import compiled

_NARROWER = 4.0
"""a, in units of the sharpest b."""
_STEP = 0.3675
"""d, in units of the sharpest Gaussian's radius: good to 2e-6 with `_TAPS` points."""
_TAPS = 10
"""Grid points that a source is spread over, each way."""
_BEFORE = _TAPS // 2 - 1
_FALL = _NARROWER * _STEP * _STEP
"""a d^2."""
_WIDE = 16
"""Taps of a row, filled up with zeros: for two kinds of weight as many as the compiler takes at
once, which is twice as fast."""
_AT_TAPS = np.zeros(_WIDE, np.float32)
_AT_TAPS[:_TAPS] = np.exp(-_FALL * np.arange(-_BEFORE, _TAPS - _BEFORE) ** 2.0)


@dataclass(frozen=True, eq=False)
class FastGaussTransform:
    """The weights of scattered sources, spread over the points of a regular grid.

    Attributes
    ----------
    x, y : (nx,), (ny,) float64, where the grid's points are
    spread : (ny, 2 nx) float32, two kinds of weight by turns
    sharpness : a, of the Gaussian they were spread by
    """

    x: Doubles
    y: Doubles
    spread: Floats
    sharpness: float

    @classmethod
    def of(
        cls, x: Doubles, y: Doubles, weights: tuple[NDArray[np.floating], NDArray[np.floating]],
        sharpest: float,
    ) -> "FastGaussTransform":
        """Spread two kinds of weight at (x, y), (n,) each, for Gaussians with b <= sharpest."""
        step = _STEP / np.sqrt(sharpest)
        grid_x, taps_x = _taps(x, step)
        grid_y, taps_y = _taps(y, step)
        spread = np.zeros((len(grid_y), 2 * (len(grid_x) + _WIDE - _TAPS)), np.float32)
        one, other = (np.asarray(kind, np.float32) for kind in weights)
        _spread(*taps_x, *taps_y, one, other, _AT_TAPS, spread)
        return cls(grid_x, grid_y, spread[:, :2 * len(grid_x)], _NARROWER * sharpest)

    def weights(self, kind: int) -> Floats:
        """Give one kind of weight on the grid, (ny, nx)."""
        return self.spread[:, kind::2]

    def factors(self, points: Doubles, at: Doubles, b: float) -> Floats:
        """Give what a weight at each of the grid's `points` counts in a sum at each of `at`.

        points : (n,), `x` or `y`; at : (k,), t; b : sharpness of the sum's Gaussian

        Returns (k, n).
        """
        a = self.sharpness
        e = a * b / (a - b)
        gap = (at[:, None] - points).astype(np.float32)
        values: Floats = np.exp(np.float32(-e) * gap * gap)
        values *= np.float32((points[1] - points[0]) * np.sqrt((a + e) / np.pi))
        return values

    def moment_factors(
        self, points: Doubles, at: Doubles, b: float, center: float, scale: float
    ) -> Floats:
        """Give factors for weights times 1, u, u^2, where u = (x - center) / scale, (3, k, n).

        Summed over the grid, s has the mean (a x + e t) / (a + e) and a variance of
        1 / (2 (a + e)): x and x^2 follow from it.
        """
        a = self.sharpness
        e = a * b / (a - b)
        plain = self.factors(points, at, b)
        u = ((((a + e) * points - e * at[:, None]) / a - center) / scale).astype(np.float32)
        first = plain * u
        return np.stack(
            [plain, first, first * u - np.float32((a + e) / (2 * (a * scale) ** 2)) * plain])


def _taps(values: Doubles, step: float) -> tuple[Doubles, tuple[Ints, Floats, Floats]]:
    """Give the grid's points, and each value's first tap and its Gaussian at all taps.

    That Gaussian is a first value and a ratio: first, first ratio, first ratio^2, ... times
    `_AT_TAPS`.
    """
    low = float(values.min())
    cells = (values - low) / step
    tap = cells.astype(np.int32)
    part = (cells - tap).astype(np.float32)
    points = low + step * np.arange(-_BEFORE, int(tap.max()) + _TAPS - _BEFORE, dtype=np.float64)
    return points, (tap, np.exp(np.float32(-_FALL) * part * (part + np.float32(2 * _BEFORE))),
                    np.exp(np.float32(2 * _FALL) * part))


@compiled
def _spread(
    column: Ints, first_x: Floats, ratio_x: Floats, row: Ints, first_y: Floats, ratio_y: Floats,
    one: Floats, other: Floats, at_taps: Floats, spread: Floats,
) -> None:
    """Add both weights of each point to the grid, by turns."""
    along_x, along_y = np.zeros(2 * len(at_taps), np.float32), np.zeros(_TAPS, np.float32)
    for i in range(len(one)):
        power_x, power_y = first_x[i], first_y[i]
        for k in range(_TAPS):
            here = power_x * at_taps[k]
            along_x[2 * k], along_x[2 * k + 1] = one[i] * here, other[i] * here
            along_y[k] = power_y * at_taps[k]
            power_x *= ratio_x[i]
            power_y *= ratio_y[i]
        begin = 2 * column[i]
        for k in range(_TAPS):
            line = spread[row[i] + k, begin:begin + len(along_x)]
            factor = along_y[k]
            for j in range(len(along_x)):
                line[j] += factor * along_x[j]
