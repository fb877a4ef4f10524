"""Stage 4: the mean spacing of the seeds, from which R0 follows."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon._compiled import compiled
from recon.settings import Neighbors

__all__ = ["exact_spacing", "lattice_spacing", "mean_spacing", "randomized_neighbors",
           "randomized_spacing"]

_FLANN_INDEX_KDTREE = 1
_TREES = 4
# 8 checks overestimate the spacing by up to a tenth, 32 are right.
_CHECKS = 32
_NOWHERE = np.float32(1e9)
# Square millimetres: no two seeds are as far apart, and each is farther from nowhere.
_FAR = np.float32(1e12)


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
    nearest = _nearest_around(xy, pixels - low, *(int(most) for most in pixels.max(axis=0) - low))
    found = nearest[nearest < _FAR]
    return float(np.sqrt(found).mean(dtype=np.float64)) if len(found) else exact_spacing(xy)


@compiled
def _nearest_around(
    xy: NDArray[np.float32], places: NDArray[np.int32], last_row: int, last_column: int
) -> NDArray[np.float32]:
    """The squared distance of each seed to the nearest among the 24 pixels around it; else 1e12."""
    # Where there is no seed, the plane is far away; so it is on two pixels all around.
    rows, columns = last_row + 5, last_column + 5
    x, y = np.full((rows, columns), _NOWHERE), np.full((rows, columns), _NOWHERE)
    for i in range(len(places)):
        row, column = places[i, 0] + 2, places[i, 1] + 2
        x[row, column], y[row, column] = xy[i, 0], xy[i, 1]
    nearest = np.full((rows, columns), _FAR)
    for row in range(2, rows - 2):
        for down in range(3):
            for right in range(-2 if down else 1, 3):
                here, there = slice(2, columns - 2), slice(2 + right, columns - 2 + right)
                x1, x2 = x[row, here], x[row + down, there]
                y1, y2 = y[row, here], y[row + down, there]
                least, other = nearest[row, here], nearest[row + down, there]
                for k in range(columns - 4):
                    across, along = x1[k] - x2[k], y1[k] - y2[k]
                    gap = across * across + along * along
                    least[k] = min(least[k], gap)
                    other[k] = min(other[k], gap)
    squared = np.empty(len(places), np.float32)
    for i in range(len(places)):
        squared[i] = nearest[places[i, 0] + 2, places[i, 1] + 2]
    return squared
