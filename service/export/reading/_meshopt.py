"""What EXT_meshopt_compression packed, unpacked: for files of ours, and of gltfpack.

From the specification of the glTF extension (Khronos, EXT_meshopt_compression, ratified; appendix
A: bitstream, appendix B: filters).
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["unpack"]

_ATTRIBUTES, _TRIANGLES = 0xA0, 0xE1
_GROUP, _BLOCK_BYTES, _BLOCK_ELEMENTS = 16, 8192, 256
_TAIL_BYTES, _TABLE_BYTES = 32, 16
_MOST_BYTES = 2**28
"""Of what is unpacked."""


def unpack(
    data: bytes, *, mode: object, count: object, stride: object, packing: object
) -> bytes:
    """Give the bytes of a view; ValueError where they are not packed as the extension says.

    Parameters
    ----------
    mode, count, stride, packing : as the document has them; `packing` is the filter
    """
    if (type(count) is not int or type(stride) is not int or not 0 < stride <= 256
            or not 0 < count * stride <= _MOST_BYTES):
        raise ValueError("a packed view of no size")
    if mode == "ATTRIBUTES" and stride % 4 == 0:
        return _filtered(_attributes(data, count, stride), packing).tobytes()
    if mode == "TRIANGLES" and stride in (2, 4) and count % 3 == 0:
        return _triangles(data, count // 3).astype(f"<u{stride}").tobytes()
    raise ValueError(f"packed by mode {str(mode)[:20]}, expected ATTRIBUTES or TRIANGLES")


def _attributes(data: bytes, count: int, stride: int) -> NDArray[np.uint8]:
    """Unpack mode 0: (count, stride)."""
    tail = max(_TAIL_BYTES, stride)
    if len(data) < 1 + tail or data[0] != _ATTRIBUTES:
        raise ValueError("no packed elements of version 0")
    # A block has at least a quarter of a byte for each group of each byte of an element.
    if count * stride > len(data) * _GROUP * 4:
        raise ValueError(f"cut short: {count} packed elements announced")
    size = min((_BLOCK_BYTES // stride) & ~(_GROUP - 1), _BLOCK_ELEMENTS)
    body = np.frombuffer(data, np.uint8)
    end, at = len(data) - tail, 1
    steps = np.zeros((-(-count // _GROUP) * _GROUP, stride), np.uint8)
    for start in range(0, count, size):
        groups = -(-min(size, count - start) // _GROUP)
        for byte in range(stride):
            heads, at = data[at:at + -(-groups // 4)], at + -(-groups // 4)
            for group in range(groups):
                if at > end:
                    raise ValueError("cut short within packed elements")
                kind = heads[group >> 2] >> (2 * (group & 3)) & 3
                if not kind:
                    continue
                row = start + group * _GROUP
                steps[row:row + _GROUP, byte], at = _group(body, at, kind)
    if at != end:
        raise ValueError("packed elements of another length")
    shifted = (steps >> 1) ^ (-(steps & 1).astype(np.int8)).view(np.uint8)
    first = np.frombuffer(data, np.uint8, stride, len(data) - stride)
    done = np.cumsum(shifted, axis=0, dtype=np.uint8) + first
    return np.asarray(done[:count], np.uint8)


def _group(body: NDArray[np.uint8], at: int, kind: int) -> tuple[NDArray[np.uint8], int]:
    """Give the 16 deltas of a group, and where the next begins."""
    if kind == 3:
        values = body[at:at + _GROUP]
        at += _GROUP
    else:
        bits = 2 * kind
        used = _GROUP * bits // 8
        shifts = np.arange(8 - bits, -1, -bits, dtype=np.uint8)
        top = (1 << bits) - 1
        values = ((body[at:at + used, None] >> shifts) & np.uint8(top)).ravel()
        at += used
        if len(values) == _GROUP:
            own = values == top
            given = body[at:at + int(own.sum())]
            if len(given) < own.sum():
                raise ValueError("cut short within packed elements")
            values[own] = given
            at += len(given)
    if len(values) < _GROUP:
        raise ValueError("cut short within packed elements")
    return values, at


def _filtered(rows: NDArray[np.uint8], packing: object) -> NDArray[np.uint8]:
    if packing in (None, "NONE"):
        return rows
    if packing != "OCTAHEDRAL" or rows.shape[1] not in (4, 8):
        raise ValueError(f"packed with the filter {str(packing)[:20]}, expected OCTAHEDRAL or none")
    kind = np.dtype("<i1" if rows.shape[1] == 4 else "<i2")
    coded = np.ascontiguousarray(rows).view(kind)
    flat = coded[:, :2] / np.maximum(coded[:, 2:3].astype(np.float64), 1)
    z = 1 - np.abs(flat).sum(axis=1)
    xy = flat - np.copysign(np.minimum(z, 0)[:, None], flat)
    normals = np.concatenate([xy, z[:, None]], axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    done = coded.copy()
    done[:, :3] = np.rint(normals * np.iinfo(kind).max)
    return done.view(np.uint8)


def _triangles(data: bytes, count: int) -> NDArray[np.int64]:
    """Unpack mode 1: the corners of `count` triangles, (3 * count,)."""
    if len(data) < 1 + count + _TABLE_BYTES or data[0] != _TRIANGLES:
        raise ValueError("no packed triangles of version 1, or fewer than announced")
    return np.array(_Corners(data, count).read(), np.int64)


class _Corners:
    """The state of a reader of triangles: what the appendix calls `next`, `last` and the FIFOs."""

    def __init__(self, data: bytes, count: int) -> None:
        self._codes, self._data = data[1:1 + count], data
        self._at, self._end = 1 + count, len(data) - _TABLE_BYTES
        self._next = self._last = 0
        self._edges = [(0, 0)] * 16
        self._points = [0] * 16

    def read(self) -> list[int]:
        """Give the corners of all triangles."""
        done: list[int] = []
        for code in self._codes:
            if code < 0xF0:
                a, b = self._edges[-1 - (code >> 4)]
                c = self._third(code & 15)
                self._edges += (c, b), (a, c)
            else:
                a, b, c = self._anew(code)
                self._edges += (b, a), (c, b), (a, c)
            done += a, b, c
            if len(self._edges) > 4096:
                del self._edges[:-16], self._points[:-16]
        if self._at != self._end:
            raise ValueError("packed triangles of another length")
        return done

    def _third(self, how: int) -> int:
        """Give the corner of a triangle that goes on from an edge."""
        if 0 < how < 13:
            return self._points[-1 - how]
        if not how:
            return self._new()
        if how == 15:
            return self._given()
        self._last += 1 if how == 14 else -1
        self._points.append(self._last)
        return self._last

    def _anew(self, code: int) -> tuple[int, int, int]:
        """Give the corners of a triangle that goes on from no edge."""
        if code < 0xFE:
            how = self._data[self._end + (code & 15)]
        else:
            how = self._byte()
            if not how:
                self._next = 0
        before = len(self._points)  # what is numbered in the list is so as of the last triangle
        a = self._given() if code == 0xFF else self._new()
        return a, self._corner(how >> 4, before), self._corner(how & 15, before)

    def _corner(self, how: int, before: int) -> int:
        if not how:
            return self._new()
        return self._given() if how == 15 else self._points[before - how]

    def _new(self) -> int:
        self._next += 1
        self._points.append(self._next - 1)
        return self._next - 1

    def _given(self) -> int:
        folded = shift = 0
        while True:
            byte = self._byte()
            folded |= (byte & 127) << shift
            shift += 7
            if byte < 128 or shift > 28:
                break
        self._last += -1 - (folded >> 1) if folded & 1 else folded >> 1
        self._points.append(self._last)
        return self._last

    def _byte(self) -> int:
        if self._at >= self._end:
            raise ValueError("cut short within packed triangles")
        self._at += 1
        return self._data[self._at - 1]
