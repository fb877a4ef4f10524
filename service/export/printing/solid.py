"""A face as a closed solid: a relief on a plate, or a hollow mask.

Both are made of surfaces over the plane and walls between them, on common corners: closed,
oriented and manifold by construction, whatever the face's outline.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bytes, Floats, Ints
from denseface.recon.face import DenseCloud
from denseface.service.export.printing._cutting import Mesh, cut, grid_mesh
from denseface.service.export.printing._relief import Relief, relief
from denseface.service.export.printing.choice import Printing

__all__ = ["Solid", "make_solid"]

_MARGIN_MM = 5.0
"""Of the plate, around the face, as printed."""
_RISE_MM = 1.0
"""Of the face's lowest point above the plate, as printed: its outline shows all around."""
_PLAIN = np.array([205, 203, 198], np.uint8)
"""RGB of what is no face: the plate, the mask's inside."""
_FINE = 3
"""Places, at least, within the thickness of a mask's wall where its inside is looked for."""
_X, _Y, _HEIGHT, _COLOR, _INSIDE, _PLATE = 0, 1, 2, slice(3, 6), 6, 7
"""Columns of the values that are cut; the mask has the back's height for the plate."""


class Solid(NamedTuple):
    """A closed mesh that rests on the bed.

    Attributes
    ----------
    points : (n, 3) float32, mm as printed: x right, y toward the forehead, z up; all are positive,
        the lowest is 0
    triangles : (t, 3) int32, counter-clockwise seen from outside
    colors : (n, 3) uint8, sRGB
    paint : (t, 3) int32, row of `colors` of each triangle's corner: walls have the face's colour
    """

    points: Floats
    triangles: Ints
    colors: Bytes
    paint: Ints


def make_solid(cloud: DenseCloud, printing: Printing) -> Solid:
    """Make the solid of a face that is chosen, `plate` or `mask`.

    Raises
    ------
    FormatError
        No part of the face is wide enough to be printed.
    """
    if printing.solid == "mask":
        return _mask(relief(cloud, printing.height_mm, 0.0, islands=False), printing.wall_mm)
    return _plate(relief(cloud, printing.height_mm, _MARGIN_MM, islands=True), printing.wall_mm)


def _plate(face: Relief, thickness_mm: float) -> Solid:
    whole = grid_mesh(_columns(face, _around(face)))
    plate = cut(whole, whole.values[:, _PLATE])
    top = Mesh(plate.values, plate.inside)
    parts = cut(top, plate.values[:, _INSIDE])
    values, count = parts.values, len(parts.values)
    upper = _placed(values, values[:, _HEIGHT] * face.scale)
    upper[:, 2] += thickness_mm + _RISE_MM - upper[np.unique(parts.inside), 2].min()
    lower, bottom = upper.copy(), upper.copy()
    lower[:, 2], bottom[:, 2] = thickness_mm, 0.0
    edges = plate.outline
    center = np.append(upper[edges[:, 0], :2].mean(axis=0), 0.0)
    # The plate's outline is round: all of it is seen from its middle.
    fan = np.stack([edges[:, 1], edges[:, 0], np.full(len(edges), count)], axis=1)
    wall = _wall(parts.outline, count)
    triangles = np.concatenate([
        parts.inside, wall, parts.outside + count, _wall(edges, count) + count, fan + 2 * count])
    colors = np.vstack([_rounded(values), np.tile(_PLAIN, (2 * count + 1, 1))])
    paint = triangles.copy()
    paint[len(parts.inside):][:len(wall)] %= count
    return _resting(np.vstack([upper, lower, bottom, center]), triangles, colors, paint)


def _mask(face: Relief, wall_mm: float) -> Solid:
    grid = grid_mesh(_columns(face, _behind(face, wall_mm)))
    parts = cut(grid, grid.values[:, _INSIDE])
    values, count = parts.values, len(parts.values)
    front = _placed(values, values[:, _HEIGHT] * face.scale)
    back = _placed(values, values[:, _PLATE])
    wall = _wall(parts.outline, count)
    triangles = np.concatenate([parts.inside, wall, parts.inside[:, ::-1] + count])
    colors = np.vstack([_rounded(values), np.tile(_PLAIN, (count, 1))])
    paint = triangles.copy()
    paint[len(parts.inside):][:len(wall)] %= count
    points = np.vstack([front, back])
    return _resting(points @ _stable(points[np.unique(triangles)]).T, triangles, colors, paint)


def _columns(face: Relief, last: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give what is interpolated where the grid is cut: x and y as printed, and so on."""
    rows, columns = face.heights.shape
    v, u = np.mgrid[:rows, :columns] * face.spacing_mm
    return np.dstack([u, -v, face.heights, face.colors, face.inside, last]).astype(np.float64)


def _around(face: Relief) -> NDArray[np.float64]:
    """Give a function that is positive on the plate: the face's convex hull, and a margin."""
    spots = np.argwhere(face.inside > 0)[:, ::-1].astype(np.int32)
    hull = np.zeros(face.inside.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(spots), 1)
    away = cv2.distanceTransform(1 - hull, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    away = np.asarray(cv2.GaussianBlur(away, (0, 0), 2.0), np.float64)
    reach = max(_MARGIN_MM / face.spacing_mm, 2.0) - away
    return np.where(np.abs(reach) < 0.02, 0.02, reach)


def _behind(face: Relief, wall_mm: float) -> NDArray[np.float64]:
    """Give the height of the mask's inside, as printed: a ball of the wall's radius just fits.

    Where a ball rolls along the front from behind, its far side is the surface at that distance;
    its height over the plane is a grey erosion of the front by the ball, and meets itself nowhere.
    """
    times = max(1, int(np.ceil(_FINE * face.spacing_mm / wall_mm)))
    rows, columns = face.heights.shape
    front: Floats = face.heights * np.float32(face.scale)
    if times > 1:
        where = np.array([[1 / times, 0, 0], [0, 1 / times, 0]])
        front = np.asarray(cv2.warpAffine(
            front, where, (columns * times, rows * times),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE),
            np.float32)
    fine = face.spacing_mm / times
    reach = int(wall_mm / fine)
    padded = cv2.copyMakeBorder(front, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    behind = np.full((rows, columns), np.inf, np.float32)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            depth = wall_mm**2 - (dx * dx + dy * dy) * fine**2
            if depth >= 0:
                shifted = padded[reach + dy:, reach + dx:][:rows * times:times,
                                                           :columns * times:times]
                np.minimum(behind, shifted - np.float32(np.sqrt(depth)), out=behind)
    return behind.astype(np.float64)


def _placed(values: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([values[:, _X], values[:, _Y], heights])


def _wall(edges: Ints, below: int) -> Ints:
    """Join the edges of an outline, the inside at the left, to those `below` rows on."""
    a, b = edges.T
    return np.stack([b, a, a + below, b, a + below, b + below], axis=1).reshape(-1, 3)


def _rounded(values: NDArray[np.float64]) -> Bytes:
    return np.clip(np.round(values[:, _COLOR]), 0, 255).astype(np.uint8)


def _stable(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the rotation by which the points rest on a plane, their back down, and do not tip over.

    That plane is the facet of their convex hull which is straight below their mean.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:  # all in one plane
        return np.eye(3)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    down = normals[:, 2] < -1e-6
    heights = -(normals[down, :2] @ points.mean(axis=0)[:2] + offsets[down]) / normals[down, 2]
    normal = normals[down][heights.argmax()]
    # The shortest rotation that turns the normal straight down.
    axis = np.cross(normal, (0.0, 0.0, -1.0))
    sine, cosine = float(np.linalg.norm(axis)), float(-normal[2])
    if sine < 1e-9:
        return np.eye(3)
    rotation, _ = cv2.Rodrigues(axis / sine * np.arctan2(sine, cosine))
    return np.asarray(rotation)


def _resting(
    points: NDArray[np.float64], triangles: Ints, colors: Bytes, paint: Ints
) -> Solid:
    """Leave out corners of no triangle, and put the solid on the bed."""
    used, numbers = np.unique(triangles, return_inverse=True)
    shown, painted = np.unique(paint, return_inverse=True)
    points = points[used] - points[used].min(axis=0)
    return Solid(points.astype(np.float32), numbers.reshape(-1, 3).astype(np.int32),
                 colors[shown], painted.reshape(-1, 3).astype(np.int32))
