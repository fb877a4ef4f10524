"""OpenNI's depth codec `16zT`: differences of neighbours, of ranks among the values of the image.

The stream is a table of the values that occur, then the rank of the first pixel, then what follows
for each next one: the difference before - now of ranks.

- Up to 6 it is a nibble, difference + 6, and two nibbles are a byte.
- Equal neighbours are the byte 0x66: up to 15 of these in a row become 0xE0 + their number.
- Larger ones are announced by a nibble 0xF, or by a byte 0xFF where a byte begins, and follow as
  difference + 192 up to 63, else as the rank in two bytes, the higher first.
- A nibble that is left over at the end is filled up by 0xD.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["MAX_VALUES", "compress_depth"]

MAX_VALUES = 2**15 - 1
"""Different values in an image, at most: the highest bit of a rank tells it from a difference."""
_SMALL, _MEDIUM = 6, 63
"""Largest difference in a nibble, and in a byte."""
_EQUAL = 0x66
_MAX_RUN = 15
"""Bytes of equal neighbours that are written as one."""


def compress_depth(depth: NDArray[np.uint16]) -> bytes:
    """Compress an image.

    Parameters
    ----------
    depth : (H, W) uint16

    Raises
    ------
    ValueError
        It has more than `MAX_VALUES` different values.
    """
    present = np.zeros(2**16, np.bool_)
    present[depth] = True
    table = np.flatnonzero(present)
    if len(table) > MAX_VALUES:
        raise ValueError(f"{len(table)} different depths, at most {MAX_VALUES} can be stored")
    rank_of = np.cumsum(present, dtype=np.int16)
    rank_of -= 1
    ranks = rank_of[depth.ravel()]
    start = np.array([len(table), *table, ranks[0]], "<u2").tobytes()
    return start + _shorten_runs(*_bytes(ranks)).tobytes()


def _bytes(ranks: NDArray[np.int16]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Give the bytes after the first rank, and which of them say that neighbours are equal."""
    difference = ranks[:-1] - ranks[1:]
    size = np.abs(difference)
    small = size <= _SMALL
    nibble = np.where(small, difference + np.int16(_SMALL), np.int16(0xF)).astype(np.uint8)
    # A large difference ends a byte, so a byte begins with every second small one after it.
    at = np.arange(len(nibble), dtype=np.int32)
    ended_at = np.maximum.accumulate(np.where(small, np.int32(-1), at))
    begins = (at - np.concatenate([[np.int32(-1)], ended_at[:-1]])) & 1 == 1
    # Pixels at which a byte is complete: with the nibble before, or as 0xFF alone.
    ends = np.flatnonzero(~(begins & small))
    alone = begins[ends]
    byte = np.where(alone, np.uint8(0xFF), nibble[ends - 1] << 4 | nibble[ends])
    further = ~small[ends]
    long = size[ends] > _MEDIUM
    starts = np.cumsum(1 + further.astype(np.int32) + long) - 1 - further - long
    out = np.empty(len(ends) + np.count_nonzero(further) + np.count_nonzero(long) + 1, np.uint8)
    equal = np.zeros(len(out), np.bool_)
    out[starts] = byte
    equal[starts] = ~further & (byte == _EQUAL)
    at, pixel = starts[further], ends[further]
    now = ranks[pixel + 1]
    out[at + 1] = np.where(long[further], now >> 8, difference[pixel] + 192)
    out[starts[long] + 2] = now[long[further]] & 0xFF
    out[-1] = nibble[-1] << 4 | 0xD if len(nibble) else 0
    left_over = bool(len(nibble) and begins[-1] and small[-1])
    return (out, equal) if left_over else (out[:-1], equal[:-1])


def _shorten_runs(tokens: NDArray[np.uint8], equal: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Write up to 15 bytes of equal neighbours as one."""
    at = np.arange(len(tokens), dtype=np.int32)
    number = at - np.maximum.accumulate(np.where(equal, np.int32(-1), at))  # in its run, from 1
    last = equal & ~np.append(equal[1:], np.False_)
    within = (number - 1) % _MAX_RUN + 1
    kept = ~equal | last | (within == _MAX_RUN)
    shortened: NDArray[np.uint8] = np.where(equal, 0xE0 + within, tokens)[kept].astype(np.uint8)
    return shortened
