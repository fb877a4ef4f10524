"""Triangles between neighbouring points of a dense cloud."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.service.errors import UsageError
from denseface.service.export.options import PLAIN, ExportOptions

__all__ = ["LONGEST_EDGE", "FaceMesh", "face_mesh", "local_spacing", "triangulate"]

LONGEST_EDGE = 2.0
"""Of a triangle, in local spacings; along a diagonal of an even slope it is the square root of 2.
"""


class FaceMesh(NamedTuple):
    """A mesh of a face: mm, camera frame, the front of each triangle toward the camera."""

    points: NDArray[np.float32]
    """(n, 3); each is a corner of a triangle."""
    normals: NDArray[np.float32]
    """(n, 3), unit length, toward the camera."""
    colors: NDArray[np.uint8]
    """(n, 3), RGB."""
    cells: NDArray[np.int32]
    """(n, 2), (row, column) on the cloud's grid."""
    triangles: NDArray[np.int32]
    """(t, 3), rows of the others."""
    step_mm: float
    """Distance of neighbouring grid points."""


def face_mesh(cloud: DenseCloud, options: ExportOptions = PLAIN) -> FaceMesh:
    """Give the mesh that is written of a dense cloud.

    Points that no triangle has are left out of it. Holes are left, or closed
    (`ExportOptions.holes`): then there are points within them, of which nothing was measured.

    Raises
    ------
    UsageError
        There is no triangle.
    """
    if options.holes == "close":
        from denseface.service.export.models.holes import without_holes

        cloud = without_holes(cloud)
    triangles = triangulate(cloud)
    if not len(triangles):
        raise UsageError("the face has no mesh: no three of its points are neighbours")
    used = np.zeros(len(cloud), np.bool_)
    used[triangles] = True
    if not used.all():
        triangles = (np.cumsum(used, dtype=np.int32) - np.int32(1))[triangles]
        return FaceMesh(cloud.points[used], cloud.normals[used], cloud.colors[used],
                        cloud.cells[used], triangles, cloud.grid_step_mm)
    return FaceMesh(cloud.points, cloud.normals, cloud.colors, cloud.cells, triangles,
                    cloud.grid_step_mm)


def local_spacing(cloud: DenseCloud) -> NDArray[np.float64]:
    """Give how far neighbours of the grid are apart on the surface at each point, mm.

    A grid step, over the cosine of the angle between the normal and the z axis: the distance that a
    step up the slope of the tangent plane covers. On a surface that the camera sees from the front
    it is the step itself, on a side of a nose of 70 degrees three of them. The normals are those of
    the fitted surface, and know nothing of a gap between two surfaces: an edge across one is long
    by this measure, however long it is.

    Returns
    -------
    (n,) float64
    """
    return cloud.grid_step_mm / np.maximum(np.abs(cloud.normals[:, 2]).astype(np.float64), 1e-6)


def triangulate(cloud: DenseCloud) -> NDArray[np.int32]:
    """Join each 2x2 block of grid points by two triangles, along its shorter diagonal.

    Parameters
    ----------
    cloud : points on a regular grid with x to the right along columns, y down along rows

    Returns
    -------
    (t, 3) int32, rows of `cloud.points`, counter-clockwise as the camera sees them, so that the
    front is toward the camera; in the order of the blocks, row by row. A block with three points
    gives one triangle. Left out are triangles with an edge longer than `LONGEST_EDGE` times the
    local spacing, the greater one of its two ends, and such as span more than `MAX_STEP` grid steps
    in depth. None is degenerate: no two points are at one place of the grid.
    """
    rows, columns = cloud.grid_shape
    index = np.full((rows, columns), -1, np.int32)
    index[cloud.cells[:, 0], cloud.cells[:, 1]] = np.arange(len(cloud), dtype=np.int32)
    blocks = np.stack([index[:-1, :-1].ravel(), index[:-1, 1:].ravel(),
                       index[1:, :-1].ravel(), index[1:, 1:].ravel()])
    blocks = blocks[:, (blocks >= 0).sum(axis=0) > 2]
    a, b, c, d = blocks
    step = cloud.grid_step_mm
    # What is not there, at -1, is nowhere: it is joined to nothing.
    z = np.append(cloud.points[:, 2].astype(np.float64), np.nan)[blocks]
    limit = np.append((LONGEST_EDGE * local_spacing(cloud)) ** 2, np.nan)[blocks]

    def joined(one: int, other: int, steps: int) -> NDArray[np.bool_]:
        deep = np.abs(z[one] - z[other])
        return np.asarray((deep**2 + steps * step**2 <= np.maximum(limit[one], limit[other]))
                          & (deep <= MAX_STEP * step))

    ab, ac, bd, cd = joined(0, 1, 1), joined(0, 2, 1), joined(1, 3, 1), joined(2, 3, 1)
    ad, bc = joined(0, 3, 2), joined(1, 2, 2)
    along_bc = (a < 0) | (d < 0) | (np.abs(z[1] - z[2]) < np.abs(z[0] - z[3]))
    # y points down: a -> c -> b is counter-clockwise seen along z.
    triangles = np.empty((len(a), 2, 3), np.int32)
    triangles[:, 0, :2] = np.stack([a, c], axis=1)
    triangles[:, 0, 2] = np.where(along_bc, b, d)
    triangles[:, 1] = np.where(along_bc, np.stack([b, c, d]), np.stack([a, d, b])).T
    kept = np.stack([np.where(along_bc, ac & bc & ab, ac & cd & ad),
                     np.where(along_bc, bc & cd & bd, ad & bd & ab)], axis=1)
    joint: NDArray[np.int32] = triangles[kept]
    return joint
