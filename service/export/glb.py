"""Binary glTF 2.0: a coloured triangle mesh that every viewer opens.

Not by Open3D: it writes sRGB colours as they are, while glTF wants them linear.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.mesh import triangulate
from denseface.service.export.provenance import provenance

__all__ = ["to_glb"]

_JSON, _BIN = 0x4E4F534A, 0x004E4942
"""Types of chunks, glTF 2.0, section 4.4.3."""
_FLOAT, _UINT = 5126, 5125
"""Component types, glTF 2.0, section 3.6.2.2."""
_VERTICES, _INDICES = 34962, 34963
"""Targets of buffer views: ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER."""
_MM_PER_M = 1000.0
_FLIP = np.array([1, -1, -1], np.float32)
"""Camera frame (y down, z forward) to glTF's (y up, z toward the viewer)."""


def to_glb(face: Face) -> bytes:
    """Give the bytes of a `.glb` file with the mesh of a face: metres, y up."""
    cloud = face.dense
    triangles = triangulate(cloud)
    positions = cloud.points * (_FLIP / np.float32(_MM_PER_M))
    # Not in 8 bits, too coarse for linear light in the shadows; nor in 16: MeshLab takes the lower
    # byte of each for the colour.
    colors = _linear(cloud.colors).astype("<f4")
    views: list[dict[str, Any]] = []
    arrays: list[bytes] = []
    for array, target in ((positions.astype("<f4"), _VERTICES),
                          ((cloud.normals * _FLIP).astype("<f4"), _VERTICES),
                          (colors, _VERTICES), (triangles.astype("<u4").ravel(), _INDICES)):
        views.append({"buffer": 0, "byteOffset": sum(map(len, arrays)),
                      "byteLength": array.nbytes, "target": target})
        arrays.append(array.tobytes())
    n, told = len(cloud), provenance(face.report)
    document = {
        "asset": {"version": "2.0", "generator": told.pop("generator"), "extras": told},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "face"}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3,
            "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}],
        "accessors": [
            {"bufferView": 0, "componentType": _FLOAT, "count": n, "type": "VEC3",
             "min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()},
            {"bufferView": 1, "componentType": _FLOAT, "count": n, "type": "VEC3"},
            {"bufferView": 2, "componentType": _FLOAT, "count": n, "type": "VEC3"},
            {"bufferView": 3, "componentType": _UINT, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": sum(map(len, arrays))}],
    }
    body = _chunk(_JSON, json.dumps(document, separators=(",", ":")).encode(), b" ")
    body += _chunk(_BIN, b"".join(arrays), b"\0")
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def _chunk(kind: int, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return struct.pack("<II", len(data), kind) + data


def _linear(srgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Undo the sRGB transfer curve (IEC 61966-2-1)."""
    value = srgb / 255.0
    linear: NDArray[np.float64] = np.where(
        value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear
