"""A mesh or a cloud as bytes for the page, which `frontend/src/viewer/mesh.ts` reads.

Little-endian: `DFMS`, then as uint32 the version 1, the number of points and of triangles, and
flags (1: with colours); x, y, z of each point as float32, mm, depth camera frame; three points of
each triangle as uint32; red, green, blue of each point as bytes. Nothing is packed: it goes no
farther than to a browser of this machine.
"""

import struct

from denseface.service.export.reading import Mesh

__all__ = ["MAGIC", "VERSION", "encode_mesh"]

MAGIC, VERSION = b"DFMS", 1
_COLORED = 1


def encode_mesh(mesh: Mesh) -> bytes:
    """Give the bytes."""
    triangles = mesh.triangles
    count = 0 if triangles is None else len(triangles)
    colored = mesh.colors is not None
    parts = [MAGIC, struct.pack("<IIII", VERSION, len(mesh.points), count, _COLORED * colored),
             mesh.points.astype("<f4").tobytes()]
    if triangles is not None:
        parts.append(triangles.astype("<u4").tobytes())
    if mesh.colors is not None:
        parts.append(mesh.colors.tobytes())
    return b"".join(parts)
