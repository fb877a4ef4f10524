"""Vertices and triangles packed as EXT_meshopt_compression asks for it.

Written from the specification of the glTF extension (Khronos, EXT_meshopt_compression, ratified;
appendix A: bitstream, appendix B: filters), whose words are used here. There is no Python package
of the encoder; meshoptimizer's own decoder reads what is written, in the tests.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["encode_attributes", "encode_triangles", "octahedral", "strip_order"]

_ATTRIBUTES, _TRIANGLES = 0xA0, 0xE1
"""First bytes of a stream: modes 0 and 1."""
_GROUP, _BLOCK_BYTES, _BLOCK_ELEMENTS = 16, 8192, 256
_TAIL_BYTES = 32
"""Of the baseline element, with the bytes before it."""
_SENTINELS = {1: 3, 2: 15}
"""By a group's header bits: the value from which on a delta has a byte of its own."""
_PACKED_BYTES = {1: 4, 2: 8}
_TABLE_BYTES = 16
"""Of `codeaux`: zeros, of which the first stands for three new points."""
_NEXT, _BEFORE, _AFTER, _GIVEN = 0x0, 0xD, 0xE, 0xF
"""What the third corner is of a triangle that goes on from an edge: a new point, one before or
after the last one that was given, or given."""
_THREE_NEW, _FIRST_NEW, _FIRST_GIVEN = 0xF0, 0xFE, 0xFF
"""Codes of a triangle that goes on from no edge."""


def encode_attributes(rows: NDArray[np.uint8]) -> bytes:
    """Pack elements of as many bytes each, mode 0.

    Parameters
    ----------
    rows : (n, s) bytes of the elements; s is a multiple of 4, 32 at most, n at least 1
    """
    count, stride = rows.shape
    size = min((_BLOCK_BYTES // stride) & ~(_GROUP - 1), _BLOCK_ELEMENTS)
    blocks = -(-count // size)
    steps = np.diff(rows, axis=0, prepend=rows[:1]).view(np.int8)
    folded = ((steps << 1) ^ (steps >> 7)).view(np.uint8)
    padded = np.zeros((blocks * size, stride), np.uint8)
    padded[:count] = folded
    # (block, byte of the element, group, element)
    deltas = padded.reshape(blocks, size // _GROUP, _GROUP, stride).transpose(0, 3, 1, 2)
    modes = _modes(deltas)
    heads = modes.reshape(*modes.shape[:2], -1, 4)
    heads = np.asarray((heads << np.array([0, 2, 4, 6], np.uint8)).sum(axis=3), np.uint8)
    groups = np.arange(blocks * size // _GROUP).reshape(blocks, 1, -1) * _GROUP < count
    body, there = _groups(deltas, modes)
    table = np.concatenate([heads, body.reshape(*heads.shape[:2], -1)], axis=2)
    kept = np.concatenate([
        np.broadcast_to(groups[:, :, ::4], heads.shape),
        (there & groups[..., None]).reshape(*heads.shape[:2], -1)], axis=2)
    tail = rows[0].tobytes().rjust(_TAIL_BYTES, b"\0")
    stream: bytes = bytes([_ATTRIBUTES]) + table[kept].tobytes() + tail
    return stream


def _modes(deltas: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Give the header bits of each group: by which it is smallest."""
    sizes = [np.where(deltas.any(axis=3), 255, 0),
             *(_PACKED_BYTES[mode] + (deltas >= _SENTINELS[mode]).sum(axis=3) for mode in (1, 2)),
             np.full(deltas.shape[:3], _GROUP)]
    return np.asarray(np.argmin(sizes, axis=0), np.uint8)


def _groups(
    deltas: NDArray[np.uint8], modes: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Give each group's packed deltas and those with a byte of their own, and which are there."""
    most, own = max(_PACKED_BYTES.values()), np.zeros(deltas.shape, np.bool_)
    packed = np.zeros((*modes.shape, most), np.uint8)
    there = np.zeros((*modes.shape, most), np.bool_)
    for mode, sentinel in _SENTINELS.items():
        of_mode, used = modes == mode, _PACKED_BYTES[mode]
        per_byte = _GROUP // used
        few = np.minimum(deltas[of_mode], sentinel).reshape(-1, used, per_byte)
        shifts = np.arange(per_byte - 1, -1, -1, dtype=np.uint8) * np.uint8(8 // per_byte)
        part = np.zeros((len(few), most), np.uint8)
        part[:, :used] = (few << shifts).sum(axis=2)
        packed[of_mode] = part
        there[of_mode] = np.arange(most) < used
        own[of_mode] = deltas[of_mode] >= sentinel
    own[modes == 3] = True
    return np.concatenate([packed, deltas], axis=3), np.concatenate([there, own], axis=3)


def strip_order(triangles: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Turn triangles and number their points so that `encode_triangles` needs a byte for most.

    A triangle that has an edge of the one before begins with it; points are numbered as they are
    first met.

    Parameters
    ----------
    triangles : (t, 3), in an order in which neighbours often follow each other

    Returns
    -------
    triangles : (t, 3) int32, the same, in the same order, with the new numbers
    order : (n,) int32, the old number of each new one; points of no triangle are left out
    """
    turned = triangles.copy()
    shared = (triangles[1:, :, None] == triangles[:-1, None, :]).any(axis=2)
    two = np.flatnonzero(shared.sum(axis=1) == 2) + 1
    apart = np.argmin(shared[two - 1], axis=1)
    turned[two] = np.take_along_axis(
        triangles[two], (apart[:, None] + np.array([1, 2, 3])) % 3, axis=1)
    first = _is_first(turned)
    # A first corner that is known before two new ones has no code.
    late = np.flatnonzero(~first[:, 0] & first[:, 1] & first[:, 2])
    turned[late] = np.roll(turned[late], -1, axis=1)
    order = turned.ravel()[_is_first(turned).ravel()]
    number = np.zeros(int(triangles.max()) + 1, np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    return number[turned], order


def _is_first(triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Say of each corner whether its point was in none before."""
    first = np.zeros(triangles.size, np.bool_)
    first[np.unique(triangles, return_index=True)[1]] = True
    return first.reshape(triangles.shape)


def encode_triangles(triangles: NDArray[np.int32]) -> bytes:
    """Pack triangles, mode 1; they are read as they are here, corner by corner.

    ValueError where points are not numbered by `strip_order`.
    """
    a, b = triangles[1:, 0], triangles[1:, 1]
    before = triangles[:-1]
    on_last = np.zeros(len(triangles), np.bool_)
    on_other = on_last.copy()
    # Of the triangle before, the edges (a, c) and (c, b) are the last in the list of edges.
    on_last[1:] = (a == before[:, 0]) & (b == before[:, 2])
    on_other[1:] = (a == before[:, 2]) & (b == before[:, 1])
    goes_on = on_last | on_other
    new = _is_first(triangles)
    if (not np.array_equal(triangles[new], np.arange(new.sum())) or (new[goes_on, :2]).any()
            or (~goes_on & ~new[:, 0] & new[:, 1] & new[:, 2]).any()):
        raise ValueError("points are not numbered as they are met")
    given = ~new
    given[goes_on, :2] = False
    deltas = np.zeros(triangles.shape, np.int64)
    deltas[given] = np.diff(triangles[given].astype(np.int64), prepend=0)
    codes = np.where(new[:, 0], np.where(new.all(axis=1), _THREE_NEW, _FIRST_NEW), _FIRST_GIVEN)
    step = deltas[goes_on, 2]
    third = np.where(new[goes_on, 2], _NEXT, np.where(
        step == 1, _AFTER, np.where(step == -1, _BEFORE, _GIVEN)))
    codes[goes_on] = (on_other[goes_on] << 4) | third
    beside = given.copy()
    beside[goes_on, 2] = third == _GIVEN
    details = np.where(new[:, 1], 0, 0xF0) | np.where(new[:, 2], 0, 0x0F)
    data = _data(details, ~goes_on & (codes != _THREE_NEW), deltas, beside)
    return bytes([_TRIANGLES]) + codes.astype(np.uint8).tobytes() + data + bytes(_TABLE_BYTES)


def _data(
    details: NDArray[Any], detailed: NDArray[np.bool_], deltas: NDArray[np.int64],
    beside: NDArray[np.bool_],
) -> bytes:
    """Give what stands beside the codes: a byte of some triangles, and of their corners numbers.

    Numbers are folded, so that small ones of either sign are small, and in bytes of 7 bits, the
    lowest first; all but the last of a number have the eighth bit.
    """
    folded = (deltas << 1) ^ (deltas >> 63)
    lengths = np.maximum(1, -(-np.frexp(folded.astype(np.float64))[1] // 7))
    places = np.arange(5)
    numbers = np.asarray((folded[..., None] >> (7 * places)) & 0x7F, np.uint8)
    numbers |= np.where(places < lengths[..., None] - 1, 0x80, 0).astype(np.uint8)
    there = beside[..., None] & (places < lengths[..., None])
    table = np.concatenate([details.astype(np.uint8)[:, None], numbers.reshape(len(deltas), -1)],
                           axis=1)
    kept = np.concatenate([detailed[:, None], there.reshape(len(deltas), -1)], axis=1)
    packed: bytes = table[kept].tobytes()
    return packed


def octahedral(normals: NDArray[np.floating], bits: int) -> NDArray[np.int16]:
    """Put unit vectors onto an octahedron, as filter 1 takes them back.

    Parameters
    ----------
    normals : (n, 3), unit length
    bits : of each of the two numbers, 4 to 16

    Returns
    -------
    (n, 4) int16 : the two numbers, what stands for 1 among them, and 0
    """
    one = (1 << (bits - 1)) - 1
    flat = normals.astype(np.float64) / np.abs(normals).sum(axis=1, keepdims=True, dtype=np.float64)
    xy = flat[:, :2]
    behind = (1 - np.abs(xy[:, ::-1])) * np.where(xy >= 0, 1.0, -1.0)
    xy = np.where(flat[:, 2:] >= 0, xy, behind)
    coded = np.zeros((len(normals), 4), np.int16)
    coded[:, :2] = np.rint(xy * one)
    coded[:, 2] = one
    return coded
