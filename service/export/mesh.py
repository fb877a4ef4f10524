"""Triangles between neighbouring points of a dense cloud, and files of them."""

import struct

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import MAX_STEP, DenseCloud, Face
from denseface.service.export.provenance import comments, stl_header

__all__ = ["to_obj", "to_stl", "triangulate"]


def triangulate(cloud: DenseCloud) -> NDArray[np.int32]:
    """Join each 2x2 block of grid points by two triangles.

    Parameters
    ----------
    cloud : points on a regular grid with x to the right along columns, y down along rows

    Returns
    -------
    (t, 3) int32, rows of `cloud.points`, counter-clockwise as the camera sees them, so that the
    front is toward the camera. A block with three points gives one triangle; triangles that span
    more than `MAX_STEP` grid steps in depth are left out.
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
    limit = MAX_STEP * cloud.grid_step_mm
    kept: NDArray[np.int32] = triangles[z.max(axis=1) - z.min(axis=1) <= limit]
    return kept


def to_obj(face: Face) -> bytes:
    """Give the bytes of an `.obj` file: mm, camera frame, with vertex colours and normals."""
    cloud = face.dense
    vertices = np.hstack([cloud.points, cloud.colors / 255])
    # Numbers of vertices, from 1; a vertex's normal has the same.
    faces = np.repeat(triangulate(cloud) + 1, 2, axis=1)
    return "".join([
        f"# by denseface, mm: {len(cloud)} vertices\n",
        *(f"# {line}\n" for line in comments(face.report)),
        _lines("v %.4f %.4f %.4f %.6g %.6g %.6g\n", vertices),
        _lines("vn %.6g %.6g %.6g\n", cloud.normals),
        _lines("f %d//%d %d//%d %d//%d\n", faces)]).encode()


def to_stl(face: Face) -> bytes:
    """Give the bytes of a binary `.stl` file: mm, camera frame, with the triangles' normals."""
    cloud = face.dense
    corners = cloud.points[triangulate(cloud)]
    table = np.zeros(len(corners), [
        ("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    table["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    table["corners"] = corners
    return stl_header(face.report) + struct.pack("<I", len(table)) + table.tobytes()


def _lines(line: str, rows: NDArray[np.floating | np.integer]) -> str:
    """Format a row to a line."""
    return line * len(rows) % tuple(rows.ravel().tolist())
