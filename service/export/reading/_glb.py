"""Binary glTF 2.0: the triangles and points of its scene, turned from metres, y up.

Section numbers are those of the glTF 2.0 specification (Khronos, ISO/IEC 12113).
"""

import json
import math
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.service.export.reading._images import sample
from denseface.service.export.reading._meshopt import unpack
from denseface.service.export.reading.meshes import RawMesh

__all__ = ["from_glb"]

_JSON, _BIN = 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_POINTS, _TRIANGLES = 0, 4
_MESHOPT, _TRANSFORM = "EXT_meshopt_compression", "KHR_texture_transform"
_KNOWN_EXTENSIONS = {"KHR_mesh_quantization", "KHR_materials_unlit", _MESHOPT, _TRANSFORM}
_MAX_NODES = 1000
_MAX_POINTS = 1 << 24
"""Of all meshes as often as they are shown."""
_TO_CAMERA = np.array([1000.0, -1000.0, -1000.0])
"""Metres, y up, z toward the viewer, to mm, y down, z forward."""


def from_glb(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    return _Document(*_chunks(data)).mesh()


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Give the document and the binary chunk (section 4.4)."""
    if len(data) < 20 or data[:4] != b"glTF":
        raise ValueError("does not begin with 'glTF'")
    version, length, size, kind = struct.unpack_from("<IIII", data, 4)
    if version != 2:
        raise ValueError(f"glTF version {version}, expected 2")
    if length != len(data) or kind != _JSON or 20 + size > len(data):
        raise ValueError(f"cut short, or no glTF: {len(data)} bytes, its header says {length}")
    document = json.loads(data[20:20 + size])
    if not isinstance(document, dict):
        raise ValueError("its document is no JSON object")  # noqa: TRY004 - a file's fault
    rest, body = data[20 + size:], b""
    if rest:
        size, kind = struct.unpack_from("<II", rest)
        if kind == _BIN:
            body = rest[8:8 + size]
            if len(body) < size:
                raise ValueError("cut short within its binary chunk")
    return document, body


class _Document:
    def __init__(self, document: dict[str, Any], body: bytes) -> None:
        self._document, self._body = document, body
        self._unpacked: dict[int, bytes] = {}
        unknown = set(document.get("extensionsRequired", ())) - _KNOWN_EXTENSIONS
        if unknown:
            raise ValueError(f"needs what is not read: {', '.join(sorted(map(str, unknown)))}")

    def mesh(self) -> RawMesh:
        """Put together all that the scene shows."""
        points, triangles, colors, count = [], [], [], 0
        for mesh, matrix in self._placed():
            for primitive in self._item("meshes", mesh)["primitives"]:
                mode = primitive.get("mode", _TRIANGLES)
                if mode not in (_POINTS, _TRIANGLES):
                    raise ValueError(f"primitives of mode {mode} are not read, only triangles (4) "
                                     "and points (0)")
                named = primitive["attributes"]
                positions = self._accessor(named["POSITION"], ("VEC3",))
                placed = positions @ matrix[:3, :3].T + matrix[:3, 3]
                points.append(placed * _TO_CAMERA)
                colors.append(self._colors(primitive, len(positions)))
                if mode == _TRIANGLES:
                    corners = self._corners(primitive, len(positions))
                    if np.linalg.det(matrix[:3, :3]) < 0:  # section 3.7.4: the front is mirrored
                        corners = corners[:, ::-1]
                    triangles.append(corners + count)
                count += len(positions)
                if count > _MAX_POINTS:
                    raise ValueError(f"its scene has more than {_MAX_POINTS} points")
        if not points:
            raise ValueError("its scene has no mesh")
        whole = [one for one in colors if one is not None]
        return RawMesh(np.concatenate(points),
                       np.concatenate(triangles) if triangles else None,
                       np.concatenate(whole) if len(whole) == len(colors) else None)

    def _item(self, kind: str, number: object) -> Any:
        items = self._document.get(kind, [])
        if type(number) is not int or not 0 <= number < len(items):
            raise ValueError(f"names {kind} {str(number)[:20]} of {len(items)}")
        return items[number]

    def _placed(self) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Give each mesh of the scene and where it is."""
        if "scenes" in self._document:
            roots = self._item("scenes", self._document.get("scene", 0)).get("nodes", [])
        else:
            roots = range(len(self._document.get("nodes", [])))
        left = [(root, np.eye(4)) for root in roots]
        for _ in range(_MAX_NODES):
            if not left:
                return
            if len(left) > _MAX_NODES:
                break
            number, above = left.pop()
            node = self._item("nodes", number)
            matrix = above @ _matrix(node)
            if "mesh" in node:
                yield node["mesh"], matrix
            left += [(child, matrix) for child in node.get("children", [])]
        raise ValueError(f"its scene has more than {_MAX_NODES} nodes, or a circle of them")

    def _accessor(self, number: object, types: tuple[str, ...]) -> NDArray[np.float64]:
        """Give an accessor's values; normalized ones as 0-1 or -1 to 1 (section 3.11)."""
        values, accessor = self._stored(number, types)
        done = values.astype(np.float64)
        if accessor.get("normalized") and values.dtype.kind in "iu":
            done = np.maximum(done / np.iinfo(values.dtype).max, -1.0)
        return done

    def _stored(
        self, number: object, types: tuple[str, ...]
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Give an accessor's values as they are stored, (n,) or (n, k)."""
        accessor = self._item("accessors", number)
        kind, count = accessor["type"], accessor["count"]
        if kind not in types or "sparse" in accessor or type(count) is not int or count < 1:
            raise ValueError(f"an accessor of {str(kind)[:20]}, expected {' or '.join(types)}, "
                             "not sparse")
        item = np.dtype(_COMPONENTS[accessor["componentType"]])
        view = self._item("bufferViews", accessor["bufferView"])
        data, width = self._view(accessor["bufferView"]), item.itemsize * _SIZES[kind]
        stride, start = view.get("byteStride", width), accessor.get("byteOffset", 0)
        if (type(stride) is not int or type(start) is not int or start < 0
                or not width <= stride <= 252 or start + stride * (count - 1) + width > len(data)):
            raise ValueError("an accessor goes beyond its bytes")
        shape, steps = (count, _SIZES[kind]), (stride, item.itemsize)
        values = np.ndarray(shape, item, data, start, steps)
        return (values[:, 0] if kind == "SCALAR" else values), accessor

    def _view(self, number: int) -> bytes:
        view = self._item("bufferViews", number)
        packed = view.get("extensions", {}).get(_MESHOPT)
        if packed is None:
            return self._part(view)
        if number not in self._unpacked:
            self._unpacked[number] = unpack(
                self._part(packed), mode=packed["mode"], count=packed["count"],
                stride=packed["byteStride"], packing=packed.get("filter"))
        return self._unpacked[number]

    def _part(self, view: dict[str, Any]) -> bytes:
        if view.get("buffer") != 0 or "uri" in self._item("buffers", 0):
            raise ValueError("buffers beside the file are not read")
        start, size = view.get("byteOffset", 0), view["byteLength"]
        if (type(start) is not int or type(size) is not int or start < 0 or size < 1
                or start + size > len(self._body)):
            raise ValueError("a view goes beyond the binary chunk")
        return self._body[start:start + size]

    def _corners(self, primitive: dict[str, Any], count: int) -> NDArray[np.int64]:
        if "indices" in primitive:
            corners, _ = self._stored(primitive["indices"], ("SCALAR",))
        else:
            corners = np.arange(count)
        if len(corners) % 3 or corners.dtype.kind not in "iu" or corners.max() >= count:
            raise ValueError(f"{len(corners)} corners of triangles, expected a multiple of 3, each "
                             f"one of {count} points")
        return corners.astype(np.int64).reshape(-1, 3)

    def _colors(self, primitive: dict[str, Any], count: int) -> NDArray[np.uint8] | None:
        """Give the points' own colours, or else those of the texture."""
        named = primitive["attributes"]
        if "COLOR_0" not in named:
            return self._texture(primitive, count)
        linear = self._accessor(named["COLOR_0"], ("VEC3", "VEC4"))[:, :3]
        if len(linear) != count:
            raise ValueError(f"{len(linear)} colours of {count} points")
        linear = np.clip(np.nan_to_num(linear), 0, 1)
        # IEC 61966-2-1.
        curved = np.where(linear <= 0.0031308, linear * 12.92,
                          1.055 * linear ** (1 / 2.4) - 0.055)
        return np.asarray(np.rint(curved * 255), np.uint8)


    def _texture(self, primitive: dict[str, Any], count: int) -> NDArray[np.uint8] | None:
        if "material" not in primitive:
            return None
        used = self._item("materials", primitive["material"]).get(
            "pbrMetallicRoughness", {}).get("baseColorTexture")
        if used is None or used.get("texCoord", 0) or "TEXCOORD_0" not in primitive["attributes"]:
            return None
        uv = self._accessor(primitive["attributes"]["TEXCOORD_0"], ("VEC2",))
        if len(uv) != count:
            raise ValueError(f"{len(uv)} places in the texture of {count} points")
        moved = used.get("extensions", {}).get(_TRANSFORM, {})
        if moved.get("rotation") or moved.get("texCoord"):
            return None
        uv = (uv * _numbers(moved.get("scale", (1, 1)), 2)
              + _numbers(moved.get("offset", (0, 0)), 2))
        image = self._item("images", self._item("textures", used["index"]).get("source"))
        return sample(self._view(image["bufferView"]), uv) if "bufferView" in image else None


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """Give where a node is within the one above (section 3.5.3)."""
    if "matrix" in node:
        return _numbers(node["matrix"], 16).reshape(4, 4).T
    x, y, z, w = _numbers(node.get("rotation", (0, 0, 0, 1)), 4)
    size = math.sqrt(x * x + y * y + z * z + w * w)
    if not size:
        raise ValueError("a node's rotation is none")
    x, y, z, w = x / size, y / size, z / size, w / size
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]) * _numbers(node.get("scale", (1, 1, 1)), 3)
    matrix[:3, 3] = _numbers(node.get("translation", (0, 0, 0)), 3)
    return matrix


def _numbers(values: Any, count: int) -> NDArray[np.float64]:
    numbers = np.array(values, np.float64)
    if numbers.shape != (count,) or not (np.abs(numbers) < 1e9).all():
        raise ValueError(f"{str(values)[:40]}, expected {count} numbers")
    return numbers
