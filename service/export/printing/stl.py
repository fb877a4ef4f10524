"""A face as `.stl`: the solid that is printed, or the open surface as it was measured."""

import struct

import numpy as np

from denseface.recon.face import Face
from denseface.service.export.mesh import to_stl as to_open_stl
from denseface.service.export.options import PLAIN, ExportOptions
from denseface.service.export.provenance import PRINTED, stl_header

__all__ = ["to_stl"]


def to_stl(face: Face, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of a binary `.stl` file: mm, z up from the bed, unless `open` is chosen.

    FormatError where no part of the face is wide enough to be printed.
    """
    if options.printing.solid == "open":
        return to_open_stl(face, options)
    from denseface.service.export.printing.solid import make_solid  # which needs OpenCV

    solid = make_solid(face.dense, options.printing)
    corners = solid.points[solid.triangles]
    table = np.zeros(len(corners), [
        ("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    exact = corners.astype(np.float64)
    normals = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    table["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    table["corners"] = corners
    return stl_header(face.report, PRINTED) + struct.pack("<I", len(table)) + table.tobytes()
