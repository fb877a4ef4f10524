"""Stanford's `.ply`: text and binary of either byte order.

G. Turk, "The PLY Polygon File Format", 1994. Elements but `vertex` and `face` are passed over.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from denseface.service.export.reading.meshes import RawMesh
from denseface.service.export.reading.polygons import fan, to_bytes

__all__ = ["from_ply"]

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
          "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2",
          "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 1 << 16
_MAX_ROWS = 1 << 22
"""Of lists that differ in length: each is an array of its own."""
_TOKEN = re.compile(rb"\S+")
_COLORS = (("red", "green", "blue"), ("r", "g", "b"),
           ("diffuse_red", "diffuse_green", "diffuse_blue"))
_CORNERS = ("vertex_indices", "vertex_index")


_Values = NDArray[np.generic]
_Column = list[_Values] | _Values
"""A property's values; of lists, an array for each, or a row where they are all as long."""


@dataclass
class _Property:
    name: str
    kind: str
    """NumPy's, without byte order."""
    counted_by: str = ""
    """Of a list: the kind of its length."""


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property]

    @property
    def least_bytes(self) -> int:
        """Of a row in a binary file."""
        return sum(np.dtype(one.counted_by or one.kind).itemsize for one in self.properties)


def from_ply(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    order, elements, body = _header(data)
    tokens = (found.group() for found in _TOKEN.finditer(body))
    at, points, colors, triangles = 0, None, None, None
    for element in elements:
        if order:
            columns, at = _binary(element, order, body, at)
        else:
            columns = _text(element, tokens)
        if element.name == "vertex":
            points, colors = _points(columns)
        elif element.name == "face":
            corners = next((columns[name] for name in _CORNERS if name in columns), None)
            triangles = fan(corners) if corners is not None else None
    if points is None:
        raise ValueError("has no element vertex")
    return RawMesh(points, triangles, colors)


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Give the byte order (empty of text), the elements, and what follows the header."""
    head = data[:_MAX_HEADER_BYTES]
    if not head.startswith((b"ply\n", b"ply\r")):
        raise ValueError("does not begin with 'ply'")
    end = head.find(b"\nend_header")
    body = head.find(b"\n", end + 1)
    if end < 0 or body < 0:
        raise ValueError(f"has no end_header in its first {_MAX_HEADER_BYTES} bytes")
    order, elements = None, []
    for line in head[:end].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 12:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name] if elements:
                elements[-1].properties.append(_Property(name, _kind(kind), _kind(length)))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(_Property(name, _kind(kind)))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"header: {line[:60]!r} is not understood")
    if order is None:
        raise ValueError("header: no format")
    for element in elements:
        names = [one.name for one in element.properties]
        if len(set(names)) < len(names) or not names:
            raise ValueError(f"header: element {element.name[:40]} has {len(names)} properties, "
                             "expected some, each once")
    return order, elements, data[body + 1:]


def _kind(name: str) -> str:
    if name not in _TYPES:
        raise ValueError(f"header: type {name[:20]!r} is not known")
    return _TYPES[name]


def _binary(
    element: _Element, order: str, body: bytes, at: int
) -> tuple[dict[str, _Column], int]:
    """Give each property's values, and where the next element begins."""
    if element.count * element.least_bytes > len(body) - at:
        raise ValueError(f"cut short: {element.count} of element {element.name[:40]} announced")
    # Most lists have the same lengths throughout: then rows are as long as each other.
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    place = at
    for one in element.properties:
        length = 0
        if one.counted_by:
            length = _length(body, place, order + one.counted_by) if element.count else 0
            fields.append((f"{one.name} length", order + one.counted_by))
            place += np.dtype(one.counted_by).itemsize
            fields.append((one.name, order + one.kind, length))
        else:
            fields.append((one.name, order + one.kind))
        place += np.dtype(one.kind).itemsize * (length if one.counted_by else 1)
    row = np.dtype(fields)
    if element.count * row.itemsize <= len(body) - at:
        table = np.frombuffer(body, row, element.count, at)
        if all((table[f"{one.name} length"] == row[one.name].shape[0]).all()
               for one in element.properties if one.counted_by):
            return ({one.name: table[one.name] for one in element.properties},
                    at + element.count * row.itemsize)
    return _row_by_row(element, order, body, at)


def _length(body: bytes, at: int, kind: str) -> int:
    if at + np.dtype(kind).itemsize > len(body):
        raise ValueError("cut short within a list")
    length = int(np.frombuffer(body, kind, 1, at)[0])
    if not 0 <= length <= len(body):
        raise ValueError(f"a list has the length {length}")
    return length


def _row_by_row(
    element: _Element, order: str, body: bytes, at: int
) -> tuple[dict[str, _Column], int]:
    columns = _empty(element)
    for _ in range(element.count):
        for one in element.properties:
            length = 1
            if one.counted_by:
                length = _length(body, at, order + one.counted_by)
                at += np.dtype(one.counted_by).itemsize
            kind = np.dtype(order + one.kind)
            if at + length * kind.itemsize > len(body):
                raise ValueError(f"cut short within element {element.name[:40]}")
            columns[one.name].append(np.frombuffer(body, kind, length, at))
            at += length * kind.itemsize
    done: dict[str, _Column] = {}
    for one in element.properties:
        column = columns[one.name]
        done[one.name] = column if one.counted_by else np.concatenate(column)
    return done, at


def _empty(element: _Element) -> dict[str, list[NDArray[np.generic]]]:
    if element.count > _MAX_ROWS:
        raise ValueError(f"{element.count} of element {element.name[:40]} of differing lengths, "
                         f"expected at most {_MAX_ROWS}")
    return {one.name: [] for one in element.properties}


def _text(
    element: _Element, tokens: Iterator[bytes]
) -> dict[str, _Column]:
    if not any(one.counted_by for one in element.properties):
        width = len(element.properties)
        numbers = np.fromiter(map(float, islice(tokens, element.count * width)), np.float64)
        if len(numbers) < element.count * width:
            raise ValueError(f"cut short within element {element.name[:40]}")
        with np.errstate(over="ignore", invalid="ignore"):
            table = numbers.reshape(element.count, width)
            return {one.name: table[:, column].astype(one.kind)
                    for column, one in enumerate(element.properties)}
    columns = _empty(element)
    for _ in range(element.count):
        for one in element.properties:
            length = int(next(tokens, b"-1")) if one.counted_by else 1
            row = np.fromiter(map(float, islice(tokens, max(length, 0))), np.float64)
            if length < 0 or len(row) < length:
                raise ValueError(f"cut short within element {element.name[:40]}")
            columns[one.name].append(row)
    return dict(columns)


def _points(
    columns: dict[str, _Column]
) -> tuple[NDArray[np.floating], NDArray[np.uint8] | None]:
    for name in "xyz":
        if name not in columns:
            raise ValueError(f"element vertex has no property {name}")
    points = np.stack([np.asarray(columns[name], np.float64).ravel() for name in "xyz"], axis=1)
    for names in _COLORS:
        if all(name in columns for name in names):
            return points, to_bytes(
                np.stack([np.asarray(columns[name]).ravel() for name in names], axis=1))
    return points, None
