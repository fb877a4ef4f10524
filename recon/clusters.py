"""k-means of depths, Eq. (2), solved exactly: along one axis a few sums are enough."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cluster", "split_depths"]

# The best cuts are sought among so many places, then moved to the millimetre.
_PLACES = 64
_ROUNDS = 50
# What lies outside these percentiles may be stray readings.
_MOST = (0.02, 0.98)


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
    whole = np.rint(z).astype(np.int64)
    start = int(whole.min())
    counts = np.bincount(whole - start)
    depth = np.arange(len(counts))
    # The sums over the bins before each.
    sums = np.zeros((3, len(counts) + 1))
    weighted = counts.astype(np.float64)
    for power in range(3):
        np.cumsum(weighted, out=sums[power, 1:])
        weighted *= depth
    cuts = _refined(_best_cuts(sums), sums)
    clusters = []
    for first, end in zip((0, *cuts), (*cuts, len(counts)), strict=True):
        before, up_to = sums[0][first], sums[0][end]
        if up_to > before:
            most = [before + share * (up_to - before) for share in _MOST]
            # The bins with the first, the last, and the readings at those shares.
            at = np.searchsorted(sums[0][1:], [before + 0.5, up_to - 0.5, *most])
            clusters.append(Cluster(*(start + int(value) for value in at)))
    return clusters


def _best_cuts(sums: NDArray[np.float64]) -> tuple[int, int]:
    """Try every pair of some places, (first of the second cluster, first of the third)."""
    at = np.unique(np.linspace(0, sums.shape[1] - 1, _PLACES).astype(np.int64))
    n, s, q = sums[:, at]
    spread = _spread(n[None, :] - n[:, None], s[None, :] - s[:, None], q[None, :] - q[:, None])
    total = spread[0, :, None] + spread + spread[None, :, -1]
    total[np.tril_indices(len(at), -1)] = np.inf
    first, second = np.unravel_index(np.argmin(total), total.shape)
    return int(at[first]), int(at[second])


def _spread(
    count: NDArray[np.float64], total: NDArray[np.float64], squares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sum of squared distances from the mean."""
    return squares - total**2 / np.maximum(count, 1)


def _refined(cuts: tuple[int, int], sums: NDArray[np.float64]) -> tuple[int, int]:
    """Lloyd's rounds: each cut goes to the middle between the means on its sides."""
    end = sums.shape[1] - 1
    for _ in range(_ROUNDS):
        edges = [0, *cuts, end]
        n, s = sums[0][edges], sums[1][edges]
        if not np.diff(n).all():
            break
        means = np.diff(s) / np.diff(n)
        moved = (int(np.ceil((means[0] + means[1]) / 2)), int(np.ceil((means[1] + means[2]) / 2)))
        if moved == cuts:
            break
        cuts = moved
    return cuts
