"""The mark in a frame's first rows: its number and when it was exposed (`Control.marks`).

The image is 80 square blocks wide. The first row of blocks is the time of the exposure, the second
the number, 64 bits each, the lowest first, and 16 that guard them: depth 2 or 4 m, colour black or
white. It outlives JPEG, other resolutions and YUV, but not cropping.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mark", "read_mark"]

_COLUMNS = 80
"""Blocks in the image's width."""
_GUARD = 0xA5C3
"""Of a word and its four sixteen-bit parts: what the last 16 blocks say, exclusive or."""
_DEPTH_MM = (2000, 4000)
"""Depth of a 0 and of a 1."""
_TOLERANCE = 0.25
"""How far a block may be off, by the difference of a 0 and a 1."""


class Mark(NamedTuple):
    """What a frame says of itself."""

    number: int
    """Of the exposure, on the grid of the stream's frame rate."""
    exposed_ns: int
    """By the host's `time.monotonic_ns()`."""
    mirrored: bool
    """Whether the image is: it is read from the right then."""


def read_mark(image: NDArray[Any], *, unit_um: int = 1000) -> Mark:
    """Read the mark of an image.

    Parameters
    ----------
    image : depth (H, W) in counts of `unit_um`, or colour (H, W, 3) uint8

    Raises
    ------
    ValueError
        There is none.
    """
    for mirrored in (False, True):
        words = _words(image[:, ::-1] if mirrored else image, unit_um)
        if words is not None:
            exposed, number = words
            return Mark(number, exposed, mirrored)
    raise ValueError("the image has no mark")


def _words(image: NDArray[Any], unit_um: int) -> list[int] | None:
    block = max(1, image.shape[1] // _COLUMNS)
    rows = np.asarray(image[:2 * block, :_COLUMNS * block], np.float64)
    if rows.shape[:2] != (2 * block, _COLUMNS * block):
        return None
    zero, one = (mm * 1000 / unit_um for mm in _DEPTH_MM)
    if rows.ndim == 3:
        zero, one = 0.0, 255.0
        rows = rows.mean(axis=2)
    # The middle of each block: its rim may be mixed with its neighbour.
    inner = slice(block // 4, block - block // 4)
    blocks = rows.reshape(2, block, _COLUMNS, block)[:, inner, :, inner]
    values = (blocks.mean(axis=(1, 3)) - zero) / (one - zero)
    bits = values.round()
    if np.abs(values - bits).max() > _TOLERANCE or not {0, 1} >= set(bits.flat):
        return None
    words = [sum(int(bit) << at for at, bit in enumerate(row)) for row in bits]
    if any(word >> 64 != _guard(word & 2**64 - 1) for word in words):
        return None
    return [word & 2**64 - 1 for word in words]


def _guard(word: int) -> int:
    return (_GUARD ^ word ^ word >> 16 ^ word >> 32 ^ word >> 48) & 0xFFFF
