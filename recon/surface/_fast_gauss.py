"""Sums of Gaussians over scattered points, by way of a regular grid.

A Gaussian is the product of narrower ones, summed over a regular grid of points s with step d:

    exp(-b (x - t)^2) = d sqrt((a + e) / pi) sum_s exp(-a (x - s)^2) exp(-e (s - t)^2),
    e = a b / (a - b),

to about 2 exp(-pi^2 / (d^2 (a + e))). So each scattered weight is spread by the first factor over
the few grid points around it, once; after that all sums, for any b up to the sharpest, are
products of thin matrices of the second.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["FastGaussTransform"]

# a over the sharpest b, and d in units of the sharpest's radius: good to 2e-6 with `_TAPS` points.
_NARROWER = 4.0
_STEP = 0.3675
_TAPS = 10
_BEFORE = _TAPS // 2 - 1
_FALL = _NARROWER * _STEP * _STEP  # a d^2
# Filled up with zeros, a row's taps for two kinds of weight are as many as the compiler takes at
# once: twice as fast.
_WIDE = 16
_AT_TAPS = np.zeros(_WIDE, np.float32)
_AT_TAPS[:_TAPS] = np.exp(-_FALL * np.arange(-_BEFORE, _TAPS - _BEFORE) ** 2.0)


@dataclass(frozen=True, eq=False)
class FastGaussTransform:
    """Scattered weights, spread over the points of a regular grid.

    Attributes
    ----------
    x, y : (nx,), (ny,) float64, where the grid's points are
    shares : (ny, k nx) float32, k kinds of weight, one beside the other
    sharpness : a, of the Gaussian they were spread by
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    shares: NDArray[np.float32]
    sharpness: float

    @classmethod
    def of(
        cls, x: NDArray[np.float64], y: NDArray[np.float64],
        weights: tuple[NDArray[np.floating], NDArray[np.floating]], sharpest: float,
    ) -> "FastGaussTransform":
        """Spread two kinds of weight at (x, y), (n,) each, for Gaussians with b <= sharpest."""
        step = _STEP / np.sqrt(sharpest)
        (xs, column, first_x, ratio_x), (ys, row, first_y, ratio_y) = (
            _placed(values, step) for values in (x, y))
        shares = np.zeros((len(ys), 2 * (len(xs) + _WIDE - _TAPS)), np.float32)
        one, other = (np.asarray(kind, np.float32) for kind in weights)
        _spread(column, first_x, ratio_x, row, first_y, ratio_y, one, other, _AT_TAPS, shares)
        return cls(xs, ys, shares[:, :2 * len(xs)], _NARROWER * sharpest)

    def kind(self, index: int) -> NDArray[np.float32]:
        """Give the shares of one kind of weight, (ny, nx)."""
        return self.shares[:, index::2]

    def factor(
        self, points: NDArray[np.float64], at: NDArray[np.float64], b: float
    ) -> NDArray[np.float32]:
        """Give what a share at each of the grid's `points` counts in a sum at each of `at`.

        points : (n,), `x` or `y`; at : (k,), t; b : sharpness of the sum's Gaussian

        Gives (k, n).
        """
        a = self.sharpness
        e = a * b / (a - b)
        gap = (at[:, None] - points).astype(np.float32)
        values: NDArray[np.float32] = np.exp(np.float32(-e) * gap * gap)
        values *= np.float32((points[1] - points[0]) * np.sqrt((a + e) / np.pi))
        return values

    def moments(
        self, points: NDArray[np.float64], at: NDArray[np.float64], b: float,
        center: float, scale: float,
    ) -> NDArray[np.float32]:
        """Give factors for weights times 1, u, u^2, where u = (x - center) / scale.

        Summed over the grid, s has the mean (a x + e t) / (a + e) and a variance of
        1 / (2 (a + e)): x and x^2 follow from it. Gives (3, k, n).
        """
        a = self.sharpness
        e = a * b / (a - b)
        plain = self.factor(points, at, b)
        u = ((((a + e) * points - e * at[:, None]) / a - center) / scale).astype(np.float32)
        first = plain * u
        return np.stack(
            [plain, first, first * u - np.float32((a + e) / (2 * (a * scale) ** 2)) * plain])


def _placed(
    values: NDArray[np.float64], step: float
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
    """Give the grid's points, each value's first tap, and its Gaussian at all taps.

    As its first value and a ratio: first, first ratio, first ratio^2, ... times `_AT_TAPS`.
    """
    low = float(values.min())
    cells = (values - low) / step
    tap = cells.astype(np.int32)
    part = (cells - tap).astype(np.float32)
    points = low + step * np.arange(-_BEFORE, int(tap.max()) + _TAPS - _BEFORE, dtype=np.float64)
    return (points, tap, np.exp(np.float32(-_FALL) * part * (part + np.float32(2 * _BEFORE))),
            np.exp(np.float32(2 * _FALL) * part))


@compiled
def _spread(
    column: NDArray[np.int32], first_x: NDArray[np.float32], ratio_x: NDArray[np.float32],
    row: NDArray[np.int32], first_y: NDArray[np.float32], ratio_y: NDArray[np.float32],
    one: NDArray[np.float32], other: NDArray[np.float32], at_taps: NDArray[np.float32],
    shares: NDArray[np.float32],
) -> None:
    """Add both weights of each point to `shares`, one beside the other."""
    across, down = np.zeros(2 * len(at_taps), np.float32), np.zeros(_TAPS, np.float32)
    for i in range(len(one)):
        power_x, power_y = first_x[i], first_y[i]
        for k in range(_TAPS):
            here = power_x * at_taps[k]
            across[2 * k], across[2 * k + 1] = one[i] * here, other[i] * here
            down[k] = power_y * at_taps[k]
            power_x *= ratio_x[i]
            power_y *= ratio_y[i]
        begin = 2 * column[i]
        for k in range(_TAPS):
            line = shares[row[i] + k, begin:begin + len(across)]
            factor = down[k]
            for j in range(len(across)):
                line[j] += factor * across[j]
