"""k-means of depths, Eq. (2), solved exactly: along one axis a few sums are enough."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.numerics.jit import compiled

_STARTS = 64
"""Depths among which the best cuts are sought, before they are moved to the millimetre."""
_ROUNDS = 50
"""Most rounds of Lloyd's algorithm."""
_TAILS = (0.02, 0.98)
"""Readings outside of these quantiles may be stray."""


class Cluster(NamedTuple):
    """Neighbouring depths, whole mm."""

    first: int
    last: int
    low: int
    """2nd percentile."""
    high: int
    """98th percentile."""


def split_depths(z: NDArray[np.floating]) -> list[Cluster]:
    """Divide depths into the three clusters with the least sum of squares.

    Parameters
    ----------
    z : (n,) float, mm, n >= 1; rounded to whole mm

    Returns
    -------
    The clusters that are not empty, nearest first.
    """
    start, sums = _summed(np.ascontiguousarray(z, np.float32))
    starts = np.arange(_STARTS) * (sums.shape[1] - 1) // (_STARTS - 1)
    cuts = _refined(*_best_cuts(sums, starts), sums)
    clusters = []
    for first, end in zip((0, *cuts), (*cuts, sums.shape[1] - 1), strict=True):
        before, up_to = sums[0][first], sums[0][end]
        if up_to > before:
            tails = [before + quantile * (up_to - before) for quantile in _TAILS]
            # The bins with the first, the last, and the readings at those quantiles.
            at = start + np.searchsorted(sums[0][1:], [before + 0.5, up_to - 0.5, *tails])
            clusters.append(Cluster(*at.tolist()))
    return clusters


@compiled
def _summed(z: Floats) -> tuple[int, Doubles]:
    """Give the least depth, whole mm, and running moments of the histogram, (3, bins + 1).

    One bin k for each millimetre from the least to the largest depth; over the bins before each,
    sums of their counts n, of n k and of n k^2.
    """
    half = np.float32(0.5)
    nearest = farthest = z[0]
    for one in z:
        nearest, farthest = min(nearest, one), max(farthest, one)
    start = math.floor(nearest + half)
    base = np.float32(start) - half
    counts = np.zeros(np.int64(np.uint32(farthest - base)) + 1, np.int64)
    for one in z:
        counts[np.uint32(one - base)] += 1
    sums = np.zeros((3, len(counts) + 1))
    for k in range(len(counts)):
        count = np.float64(counts[k])
        for power in range(3):
            sums[power, k + 1] = sums[power, k] + count
            count *= k
    return start, sums


@compiled
def _best_cuts(sums: Doubles, at: NDArray[np.int64]) -> tuple[int, int]:
    """Try every pair of some bins: (first of the second cluster, first of the third)."""
    least, best = 1e300, (at[0], at[0])
    for first in at:
        for second in at:
            if second >= first:
                total = (_spread(sums, 0, first) + _spread(sums, first, second)
                         + _spread(sums, second, sums.shape[1] - 1))
                if total < least:
                    least, best = total, (first, second)
    return best


@compiled
def _spread(sums: Doubles, first: int, end: int) -> float:
    """Sum of the bins' squared distances from their mean."""
    total = sums[1, end] - sums[1, first]
    return float(sums[2, end] - sums[2, first]
                 - total * total / max(sums[0, end] - sums[0, first], 1.0))


@compiled
def _refined(second: int, third: int, sums: Doubles) -> tuple[int, int]:
    """Lloyd's algorithm: each cut goes to the middle between the means on its sides."""
    end = sums.shape[1] - 1
    for _ in range(_ROUNDS):
        means = np.empty(3)
        for k, (begin, stop) in enumerate(((0, second), (second, third), (third, end))):
            count = sums[0, stop] - sums[0, begin]
            if count == 0:
                return second, third
            means[k] = (sums[1, stop] - sums[1, begin]) / count
        moved = (int(np.ceil((means[0] + means[1]) / 2)), int(np.ceil((means[1] + means[2]) / 2)))
        if moved == (second, third):
            break
        second, third = moved
    return second, third
