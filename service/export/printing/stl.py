"""A face as `.stl`: the solid that is printed, or the open surface as it was measured."""

import struct

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.mesh import face_mesh
from denseface.service.export.options import PLAIN, ExportOptions
from denseface.service.export.provenance import PRINTED, stl_header

__all__ = ["to_stl"]


def to_stl(face: Face, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of a binary `.stl` file with the triangles' normals: mm, z up from the bed.

    Where `open` is chosen it is the dense mesh in the camera's frame. FormatError where no part of
    the face is wide enough to be printed.
    """
    if options.printing.solid == "open":
        mesh = face_mesh(face.dense, options)
        return stl_header(face.report) + _body(mesh.points[mesh.triangles])
    from denseface.service.export.printing.solid import make_solid  # which needs OpenCV

    solid = make_solid(face.dense, options.printing)
    # Exactly: some of its triangles are slivers.
    corners = solid.points[solid.triangles].astype(np.float64)
    return stl_header(face.report, PRINTED) + _body(corners)


def _body(corners: NDArray[np.floating]) -> bytes:
    """Give what comes after the header, of triangles' corners, (t, 3, 3)."""
    table = np.zeros(len(corners), [
        ("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    table["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    table["corners"] = corners
    return struct.pack("<I", len(table)) + table.tobytes()
