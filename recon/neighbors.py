"""Stage 4: the mean spacing of the seeds, from which R0 follows."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.settings import Neighbors

__all__ = ["exact_spacing", "lattice_spacing", "mean_spacing", "randomized_neighbors",
           "randomized_spacing"]

_FLANN_INDEX_KDTREE = 1
_TREES = 4
# 8 checks overestimate the spacing by up to a tenth, 32 are right.
_CHECKS = 32
_FAR = np.float32(1e6)


def mean_spacing(
    points: NDArray[np.float32], pixels: NDArray[np.int32], how: Neighbors
) -> float:
    """Measure the mean distance, over (X, Y), of a seed to its nearest neighbour.

    Parameters
    ----------
    points : (n, 3) float32, mm, depth camera frame, n >= 2
    pixels : (n, 2) int32, (row, column) of each seed in the depth image
    how : how the neighbours are found

    Returns
    -------
    float, mm
    """
    if len(points) < 2:
        raise ValueError(f"points must be at least 2 to have a spacing, got {len(points)}")
    xy = np.ascontiguousarray(points[:, :2])
    if how is Neighbors.RANDOMIZED:
        return randomized_spacing(xy)
    if how is Neighbors.EXACT:
        return exact_spacing(xy)
    return lattice_spacing(xy, pixels)


def randomized_neighbors(
    xy: NDArray[np.float32], k: int, checks: int = _CHECKS
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Find the `k` nearest of each point, itself first, by randomized kd-trees.

    Silpa-Anan and Hartley, 2008, doi:10.1109/CVPR.2008.4587638, as implemented in FLANN.
    Approximate, and built anew with other random cuts each time.

    Parameters
    ----------
    xy : (n, 2) float32, mm
    k : neighbours for each point
    checks : leaves visited for each query

    Returns
    -------
    indices : (n, k) int32
    distances : (n, k) float32, mm
    """
    index = cv2.flann.Index(xy, {"algorithm": _FLANN_INDEX_KDTREE, "trees": _TREES})
    indices, squared = index.knnSearch(xy, k, params={"checks": checks})
    return np.asarray(indices, np.int32), np.sqrt(np.asarray(squared, np.float32))


def randomized_spacing(xy: NDArray[np.float32]) -> float:
    """Mean nearest-neighbour distance of (n, 2) points, mm, by randomized kd-trees."""
    indices, distances = randomized_neighbors(xy, 2)
    # An approximate search may miss the point itself; what it then lists first is a neighbour.
    own = indices[:, 0] == np.arange(len(xy))
    return float(np.where(own, distances[:, 1], distances[:, 0]).mean())


def exact_spacing(xy: NDArray[np.float32]) -> float:
    """Mean nearest-neighbour distance of (n, 2) points, mm, by an exact kd-tree."""
    distances = np.asarray(cKDTree(xy).query(xy, k=2)[0])
    return float(distances[:, 1].mean())


def lattice_spacing(xy: NDArray[np.float32], pixels: NDArray[np.int32]) -> float:
    """Mean nearest-neighbour distance of (n, 2) points, mm, from the 24 pixels around each.

    Seeds without another seed among those pixels do not count: they are stray, and there are few.
    Where no seed has one, the exact tree decides.
    """
    low = pixels.min(axis=0)
    rows, columns = pixels.max(axis=0) - low + 1
    places = tuple((pixels - low).T)
    # Where there is no seed, the plane is far away.
    x, y = np.full((2, rows, columns), _FAR, np.float32)
    x[places], y[places] = xy.T
    nearest = np.full((rows, columns), _FAR, np.float32)
    for down in range(3):
        for right in range(-2 if down else 1, 3):
            left, end = max(0, -right), columns - max(0, right)
            here = np.s_[:rows - down, left:end]
            there = np.s_[down:, left + right:end + right]
            gap = (x[here] - x[there]) ** 2 + (y[here] - y[there]) ** 2
            np.minimum(nearest[here], gap, out=nearest[here])
            np.minimum(nearest[there], gap, out=nearest[there])
    squared = nearest[places]
    found = squared < _FAR
    return float(np.sqrt(squared[found]).mean()) if found.any() else exact_spacing(xy)
