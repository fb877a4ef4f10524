"""Holes of a dense cloud, closed by points between those around them."""

from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve

from denseface.recon.face import DenseCloud

__all__ = ["without_holes"]

_T = TypeVar("_T", bound=np.generic)


def without_holes(cloud: DenseCloud) -> DenseCloud:
    """Add a point at each empty place of the grid that has the face all around.

    Depth, colour, normal and sigma of the new points are those of a membrane over the hole: each is
    the mean of its four neighbours (the discrete Laplace equation, which has one solution, between
    the values at the hole's rim). Nothing was measured there: a deep hole is closed as by a drum's
    skin.

    The given cloud is not changed; it is given back where it has no holes.
    """
    rows, columns = cloud.grid_shape
    index = np.full((rows + 2, columns + 2), -1, np.int64)
    index[cloud.cells[:, 0] + 1, cloud.cells[:, 1] + 1] = np.arange(len(cloud))
    # What is not reached from outside is within; diagonal neighbours do not let through.
    _, labels = cv2.connectedComponents((index < 0).astype(np.uint8), connectivity=4)
    inside = (index < 0) & (labels != labels[0, 0])
    count = int(inside.sum())
    if not count:
        return cloud
    number = np.full(index.shape, -1, np.int64)
    number[inside] = np.arange(count)
    at = np.argwhere(inside)
    known = np.hstack([cloud.points[:, 2:], cloud.colors, cloud.normals,
                       np.log(cloud.sigma)[:, None]]).astype(np.float64)
    near = np.stack([at + step for step in ((-1, 0), (1, 0), (0, -1), (0, 1))])
    unknown, given = number[near[..., 0], near[..., 1]], index[near[..., 0], near[..., 1]]
    self_ = np.arange(count)
    other = unknown >= 0
    row = np.broadcast_to(self_, other.shape)[other]
    matrix = csr_array((np.concatenate([np.full(count, 4.0), np.full(len(row), -1.0)]),
                        (np.concatenate([self_, row]), np.concatenate([self_, unknown[other]]))),
                       shape=(count, count))
    right = np.where(given[..., None] >= 0, known[given], 0.0).sum(axis=0)
    found = np.asarray(spsolve(matrix.tocsc(), right)).reshape(count, known.shape[1])
    return _with(cloud, at - 1, found)


def _with(
    cloud: DenseCloud, cells: NDArray[np.int64], found: NDArray[np.float64]
) -> DenseCloud:
    """Put new points in between: depth, colour, normal and logarithm of sigma of each."""
    corner = np.median(cloud.points[:, :2] - cloud.cells[:, ::-1] * cloud.grid_step_mm, axis=0)
    xy = corner + cells[:, ::-1] * cloud.grid_step_mm
    normals = found[:, 4:7] / np.linalg.norm(found[:, 4:7], axis=1, keepdims=True)
    together = np.concatenate([cloud.cells, cells.astype(np.int32)])
    order = np.lexsort(together.T[::-1])

    def merged(old: NDArray[_T], new: NDArray[np.floating]) -> NDArray[_T]:
        return np.concatenate([old, new.astype(old.dtype)])[order]

    return replace(
        cloud, points=merged(cloud.points, np.hstack([xy, found[:, :1]])),
        colors=merged(cloud.colors, np.clip(np.rint(found[:, 1:4]), 0, 255)),
        normals=merged(cloud.normals, normals),
        sigma=merged(cloud.sigma, np.exp(found[:, 7])), cells=together[order])
