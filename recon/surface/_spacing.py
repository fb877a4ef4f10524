"""Stage 4: the mean spacing of the seeds, from which R0 follows."""

import cv2
import numpy as np

from denseface.recon.arrays import Floats, Ints
from denseface.recon.numerics.jit import compiled
from denseface.recon.settings import Neighbors

_FLANN_INDEX_KDTREE = 1
_TREES = 4
_CHECKS = 32
"""Leaves visited for each query: 8 overestimate the spacing by up to a tenth, 32 are right."""
_NOWHERE = np.float32(1e9)
"""x and y of a pixel without a seed, mm."""
_FAR = np.float32(1e12)
"""mm^2: any two seeds are nearer to each other, and farther from `_NOWHERE`."""


def mean_spacing(points: Floats, pixels: Ints, how: Neighbors) -> float:
    """Measure the mean distance, mm, over (X, Y), of a seed to its nearest neighbour.

    Parameters
    ----------
    points : (n, 3) float32, mm, depth camera frame, n >= 2
    pixels : (n, 2) int32, (row, column) of each seed in the depth image
    how : how the neighbours are found
    """
    if len(points) < 2:
        raise ValueError(f"points must be at least 2 to have a spacing, got {len(points)}")
    if how is Neighbors.LATTICE:
        return lattice_spacing(points, pixels)
    xy = np.ascontiguousarray(points[:, :2])
    return randomized_spacing(xy) if how is Neighbors.RANDOMIZED else exact_spacing(xy)


def randomized_neighbors(xy: Floats, k: int, checks: int = _CHECKS) -> tuple[Ints, Floats]:
    """Find the `k` nearest of each point, itself first, by randomized kd-trees.

    Silpa-Anan and Hartley, 2008, doi:10.1109/CVPR.2008.4587638, as implemented in FLANN.
    Approximate, and built anew with other random cuts each time.

    xy : (n, 2) float32, mm; checks : leaves visited for each query

    Returns indices, (n, k) int32, and distances, (n, k) float32, mm.
    """
    index = cv2.flann.Index(xy, {"algorithm": _FLANN_INDEX_KDTREE, "trees": _TREES})
    indices, squared = index.knnSearch(xy, k, params={"checks": checks})
    return np.asarray(indices, np.int32), np.sqrt(np.asarray(squared, np.float32))


def randomized_spacing(xy: Floats) -> float:
    """Mean nearest-neighbour distance of (n, 2) points, mm, by randomized kd-trees."""
    indices, distances = randomized_neighbors(xy, 2)
    # An approximate search may miss the point itself; what it then lists first is a neighbour.
    own = indices[:, 0] == np.arange(len(xy))
    return float(np.where(own, distances[:, 1], distances[:, 0]).mean())


def exact_spacing(xy: Floats) -> float:
    """Mean nearest-neighbour distance of (n, 2) points, mm, by an exact kd-tree."""
    from scipy.spatial import cKDTree  # rarely needed, and slow to import

    return float(np.asarray(cKDTree(xy).query(xy, k=2)[0])[:, 1].mean())


def lattice_spacing(points: Floats, pixels: Ints) -> float:
    """Mean nearest-neighbour distance over (X, Y), mm, from the 24 pixels around each point.

    Seeds without another seed among those pixels do not count: they are stray, and there are few.
    Where no seed has one, the exact tree decides.

    points : (n, 2 or 3) float32, mm; pixels : (n, 2) int32
    """
    total, count = _nearest_around(points, pixels)
    return total / count if count else exact_spacing(np.ascontiguousarray(points[:, :2]))


@compiled
def _nearest_around(points: Floats, pixels: Ints) -> tuple[float, int]:
    """Sum the seeds' distances to the nearest among the 24 pixels around, and count them."""
    # Two pixels without a seed all around, so that no step leaves the image.
    top, left = pixels[:, 0].min() - 2, pixels[:, 1].min() - 2
    rows, columns = pixels[:, 0].max() - top + 3, pixels[:, 1].max() - left + 3
    x, y = np.full((rows, columns), _NOWHERE), np.full((rows, columns), _NOWHERE)
    for i in range(len(pixels)):
        row, column = pixels[i, 0] - top, pixels[i, 1] - left
        x[row, column], y[row, column] = points[i, 0], points[i, 1]
    nearest = np.full((rows, columns), _FAR)
    for row in range(2, rows - 2):
        for down in range(3):
            for shift in range(-2 if down else 1, 3):
                here, there = slice(2, columns - 2), slice(2 + shift, columns - 2 + shift)
                x1, x2 = x[row, here], x[row + down, there]
                y1, y2 = y[row, here], y[row + down, there]
                least, other = nearest[row, here], nearest[row + down, there]
                for k in range(columns - 4):
                    dx, dy = x1[k] - x2[k], y1[k] - y2[k]
                    gap = dx * dx + dy * dy
                    least[k] = min(least[k], gap)
                    other[k] = min(other[k], gap)
    total, count = 0.0, 0
    for i in range(len(pixels)):
        gap = nearest[pixels[i, 0] - top, pixels[i, 1] - left]
        if gap < _FAR:
            total += np.sqrt(gap)
            count += 1
    return total, count
