"""Triangles between neighbouring points of a dense cloud's grid."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud

__all__ = ["triangulate"]

_MAX_STEP = 10.0
"""Largest step in depth between neighbours, in grid steps: more is a gap between two surfaces."""


def triangulate(cloud: DenseCloud) -> NDArray[np.int32]:
    """Join each 2x2 block of grid points by two triangles.

    Parameters
    ----------
    cloud : points on a regular grid with x to the right along columns, y down along rows

    Returns
    -------
    (t, 3) int32, rows of `cloud.points`, counter-clockwise as the camera sees them, so that the
    front is toward the camera. A block with three points gives one triangle; triangles that span
    more than ten grid steps in depth are left out.
    """
    rows, columns = cloud.grid_shape
    index = np.full((rows, columns), -1, np.int32)
    index[cloud.cells[:, 0], cloud.cells[:, 1]] = np.arange(len(cloud), dtype=np.int32)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    # y points down: a -> c -> b is counter-clockwise seen along z.
    whole = (a >= 0) & (d >= 0)
    triangles = np.concatenate([
        np.stack([a, c, d], axis=1)[whole & (c >= 0)],
        np.stack([a, d, b], axis=1)[whole & (b >= 0)],
        np.stack([a, c, b], axis=1)[(a >= 0) & (c >= 0) & (b >= 0) & (d < 0)],
        np.stack([b, c, d], axis=1)[(a < 0) & (b >= 0) & (c >= 0) & (d >= 0)],
    ])
    z = cloud.points[:, 2][triangles]
    limit = _MAX_STEP * cloud.grid_step_mm
    kept: NDArray[np.int32] = triangles[z.max(axis=1) - z.min(axis=1) <= limit]
    return kept
