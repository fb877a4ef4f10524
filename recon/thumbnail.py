"""Small pictures of points, for a notebook: what the camera sees, by numpy alone."""

import math

import numpy as np
from numpy.typing import NDArray

from denseface.html_repr import PICTURE_SIDE
from denseface.recon.arrays import Bytes, Floats, Ints

__all__ = ["relief", "seen_from_the_camera", "seen_on_the_grid"]

_DARKEST = 0.15
"""Share of light on a surface that is seen edge on."""


def seen_on_the_grid(cells: Ints, shape: tuple[int, int], colors: Bytes) -> Bytes:
    """Draw points of a grid, one colour each, as (h, w, 4) uint8, RGBA; cut to where they are.

    Parameters
    ----------
    cells : (n, 2) rows and columns
    shape : of the grid
    colors : (n, 3) uint8, RGB
    """
    if not len(cells):
        return np.zeros((1, 1, 4), np.uint8)
    first = cells.min(axis=0)
    rows, columns = np.minimum(cells.max(axis=0) + 1, shape) - first
    return _drawn((cells - first) // math.ceil(max(rows, columns) / PICTURE_SIDE), colors)


def seen_from_the_camera(points: Floats, colors: Bytes) -> Bytes:
    """Draw points by x and y, (n, 3) mm, as (h, w, 4) uint8, RGBA."""
    if not len(points):
        return np.zeros((1, 1, 4), np.uint8)
    first = points[:, :2].min(axis=0)
    size = np.ptp(points[:, :2], axis=0)
    # As wide as points are apart, or there would be gaps.
    step = max(size.max() / (PICTURE_SIDE - 1), 1.5 * math.sqrt(size.prod() / len(points)), 1e-6)
    return _drawn(((points[:, 1::-1] - first[::-1]) / step).astype(np.int64), colors)


def relief(normals: Floats) -> Bytes:
    """Give the shades of a surface with light from the camera and above: (n, 3) uint8.

    Parameters
    ----------
    normals : (n, 3), unit length, toward the camera
    """
    light = np.array([-0.35, -0.45, -0.82], np.float32)
    lit = _DARKEST + (1 - _DARKEST) * np.clip(normals @ light, 0, 1)
    return np.repeat((255 * lit).astype(np.uint8)[:, None], 3, axis=1)


def _drawn(places: NDArray[np.integer], colors: Bytes) -> Bytes:
    """Give each place, (n, 2) row and column, the mean of its colours."""
    height, width = (places.max(axis=0) + 1).tolist()
    index = places[:, 0] * width + places[:, 1]
    count = np.bincount(index, minlength=height * width)
    image = np.zeros((height * width, 4), np.uint8)
    for channel in range(3):
        total = np.bincount(index, colors[:, channel], minlength=height * width)
        image[:, channel] = total / np.maximum(count, 1)
    image[:, 3] = np.where(count > 0, 255, 0)
    return image.reshape(height, width, 4)
