"""A glTF 2.0 document with one mesh, put together part by part, and packed as `.glb`.

Section numbers are those of the glTF 2.0 specification (Khronos, ISO/IEC 12113).
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Report
from denseface.service.export.provenance import provenance

__all__ = ["ARRAY", "FLIP", "INDICES", "MESHOPT", "MM_PER_M", "Gltf"]

_JSON, _BIN = 0x4E4F534A, 0x004E4942
"""Types of chunks (section 4.4.3)."""
_COMPONENTS = {"<f4": 5126, "<u4": 5125, "<u2": 5123, "<i2": 5122}
"""Component types (section 3.6.2.2)."""
ARRAY, INDICES = 34962, 34963
"""Targets of buffer views: ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER."""
_LINEAR, _LINEAR_OF_LINEAR, _TO_EDGE = 9729, 9987, 33071
"""Of a sampler: filters and wrapping."""
MESHOPT = "EXT_meshopt_compression"
MM_PER_M = 1000.0
FLIP = np.array([1, -1, -1], np.float32)
"""Camera frame (y down, z forward) to glTF's (y up, z toward the viewer)."""


class Gltf:
    """What a file will hold.

    Parameters
    ----------
    report : where the face comes from: `asset.extras`
    rights : `asset.copyright`, where it is not empty
    """

    def __init__(self, report: Report, rights: str) -> None:
        told = provenance(report)
        asset: dict[str, Any] = {"version": "2.0", "generator": told.pop("generator")}
        if rights:
            asset["copyright"] = rights
        self._asset = asset | {"extras": told}
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._parts: list[bytes] = []
        self._unpacked = 0
        """Bytes of the views that are compressed here."""
        self._extensions: set[str] = set()
        self._rest: dict[str, Any] = {}
        self._material: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}

    def require(self, *extensions: str) -> None:
        """Say that nobody can read the file without these."""
        self._extensions.update(extensions)

    def array(
        self, array: NDArray[Any], kind: str, target: int, *, bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Add an array as it is, and give the number of its accessor."""
        view = self._add(array.tobytes(), target=target)
        return self._accessor(array, kind, view, bounds=bounds, normalized=normalized)

    def packed(
        self, array: NDArray[Any], kind: str, target: int, data: bytes, *, mode: str,
        stride: int, count: int, packing: str = "", bounds: bool = False, normalized: bool = False,
    ) -> int:
        """Add an array that was packed by `MESHOPT`, and give the number of its accessor.

        Parameters
        ----------
        array : what is read of it
        stride, count : bytes of an element, and how many there are
        packing : the filter, `OCTAHEDRAL`; empty for none
        """
        self.require(MESHOPT)
        how: dict[str, Any] = {
            "buffer": 0, "byteOffset": self._size, "byteLength": len(data), "byteStride": stride,
            "mode": mode, "count": count}
        if packing:
            how["filter"] = packing
        view = {"buffer": 1, "byteOffset": self._unpacked, "byteLength": stride * count,
                "target": target, "extensions": {MESHOPT: how}}
        if target == ARRAY:
            view["byteStride"] = stride
        self._views.append(view)
        self._unpacked += stride * count
        self._parts.append(data + bytes(-len(data) % 4))
        return self._accessor(array, kind, len(self._views) - 1, bounds=bounds,
                              normalized=normalized)

    def texture(self, jpeg: bytes, transform: dict[str, Any] | None = None) -> None:
        """Give the mesh an image; `transform` is what KHR_texture_transform says of it."""
        used: dict[str, Any] = {"index": 0}
        if transform:
            self.require("KHR_texture_transform")
            used["extensions"] = {"KHR_texture_transform": transform}
        self._material["baseColorTexture"] = used
        self._rest = {
            "textures": [{"source": 0, "sampler": 0}],
            "images": [{"bufferView": self._add(jpeg), "mimeType": "image/jpeg"}],
            "samplers": [{"magFilter": _LINEAR, "minFilter": _LINEAR_OF_LINEAR,
                          "wrapS": _TO_EDGE, "wrapT": _TO_EDGE}]}

    def pack(
        self, attributes: dict[str, int], indices: int, placed: dict[str, Any] | None = None
    ) -> bytes:
        """Give the file's bytes: one mesh of these accessors, at a place."""
        buffers: list[dict[str, Any]] = [{"byteLength": self._size}]
        if self._unpacked:
            buffers.append({"byteLength": self._unpacked,
                            "extensions": {MESHOPT: {"fallback": True}}})
        document: dict[str, Any] = {"asset": self._asset}
        if self._extensions:
            document["extensionsUsed"] = document["extensionsRequired"] = sorted(self._extensions)
        document |= {
            "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "face", **(placed or {})}],
            "meshes": [{"primitives": [{
                "attributes": attributes, "indices": indices, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": self._material}],
            **self._rest, "accessors": self._accessors, "bufferViews": self._views,
            "buffers": buffers}
        body = _chunk(_JSON, json.dumps(document, separators=(",", ":")).encode(), b" ")
        body += _chunk(_BIN, b"".join(self._parts), b"\0")
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body

    @property
    def _size(self) -> int:
        return sum(map(len, self._parts))

    def _add(self, data: bytes, **more: int) -> int:
        self._views.append({"buffer": 0, "byteOffset": self._size, "byteLength": len(data), **more})
        self._parts.append(data + bytes(-len(data) % 4))
        return len(self._views) - 1

    def _accessor(
        self, array: NDArray[Any], kind: str, view: int, *, bounds: bool, normalized: bool
    ) -> int:
        accessor = {"bufferView": view, "componentType": _COMPONENTS[array.dtype.str],
                    "count": len(array), "type": kind}
        if normalized:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _chunk(kind: int, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return struct.pack("<II", len(data), kind) + data
