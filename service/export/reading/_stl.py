"""`.stl`, binary and text: triangles whose corners are joined to points again."""

import re
import struct

import numpy as np

from denseface.service.export.reading.meshes import RawMesh
from denseface.service.export.reading.polygons import joined

__all__ = ["from_stl"]

_HEAD_BYTES, _TRIANGLE_BYTES = 84, 50
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def from_stl(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    # Some binary files begin with `solid`, as those of text do: their length tells.
    if len(data) >= _HEAD_BYTES:
        (count,) = struct.unpack_from("<I", data, 80)
        if len(data) == _HEAD_BYTES + count * _TRIANGLE_BYTES:
            table = np.frombuffer(data, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)),
                                         ("attributes", "<u2")], count, _HEAD_BYTES)
            return _joined(table["corners"].astype(np.float32))
    if not data.lstrip().lower().startswith(b"solid"):
        raise ValueError("no .stl file, or one that is cut short: its length is not what its "
                         "number of triangles asks for")
    corners = np.fromiter((float(number) for vertex in _VERTEX.finditer(data)
                           for number in vertex.groups()), np.float64)
    if len(corners) % 9 or b"endsolid" not in data[-1024:].lower():
        raise ValueError("cut short: the last triangle or endsolid is missing")
    with np.errstate(over="ignore"):
        return _joined(corners.astype(np.float32).reshape(-1, 3, 3))


def _joined(corners: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> RawMesh:
    return RawMesh(*joined(corners))
