"""`.stl`, binary and text: triangles whose corners are joined to points again.

A solid of ours that stands on a printer's bed is laid back: to z forward, y down.
"""

import re
import struct

import numpy as np

from denseface.service.export.provenance import PRINTED
from denseface.service.export.reading.meshes import RawMesh
from denseface.service.export.reading.polygons import joined

__all__ = ["from_stl"]

_HEAD_BYTES, _TRIANGLE_BYTES = 84, 50
_FROM_BED = np.array([1, -1, -1], np.float32)
"""The printer's frame, z up and y toward the forehead, to a camera's that looks down on the bed."""
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def from_stl(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    # Some binary files begin with `solid`, as those of text do: their length tells.
    if len(data) >= _HEAD_BYTES:
        (count,) = struct.unpack_from("<I", data, 80)
        if len(data) == _HEAD_BYTES + count * _TRIANGLE_BYTES:
            table = np.frombuffer(data, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)),
                                         ("attributes", "<u2")], count, _HEAD_BYTES)
            corners = table["corners"].astype(np.float32)
            return _joined(corners * _FROM_BED if data.startswith(PRINTED.encode()) else corners)
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
