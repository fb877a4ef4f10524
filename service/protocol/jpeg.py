"""The size that a JPEG says it has, read before anyone decodes it (ITU-T T.81, Annex B)."""

import struct

__all__ = ["jpeg_size"]

_START, _START_OF_SCAN, _BASELINE = 0xD8, 0xDA, 0xC0
"""Markers: of the file's start, of its coded data, and of a baseline frame."""
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers that begin a frame; of these only the baseline one is taken: it is read in one pass."""
_CHANNELS = 1, 3
"""Components that a picture may have: grey, or colour."""


def jpeg_size(data: bytes | memoryview) -> tuple[int, int]:
    """Give width and height of a baseline JPEG of 8 bits, pixels.

    Raises
    ------
    ValueError
        Where the bytes do not begin as such a file does.
    """
    if bytes(data[:2]) != bytes((0xFF, _START)):
        raise ValueError("does not begin as a JPEG")
    at = 2
    while at + 4 <= len(data):
        prefix, marker, length = struct.unpack_from(">BBH", data, at)
        if prefix != 0xFF or length < 2:
            raise ValueError(f"has no marker at byte {at}")
        if marker in _FRAMES:
            return _frame_size(marker, bytes(data[at + 4:at + 2 + length]))
        if marker == _START_OF_SCAN:
            break
        at += 2 + length
    raise ValueError("has no frame header")


def _frame_size(marker: int, segment: bytes) -> tuple[int, int]:
    if marker != _BASELINE:
        raise ValueError(f"is no baseline JPEG (marker FF{marker:02X})")
    if len(segment) < 6:
        raise ValueError("has a frame header that is cut short")
    bits, height, width, channels = struct.unpack_from(">BHHB", segment)
    if bits != 8 or channels not in _CHANNELS:
        raise ValueError(f"has {channels} channels of {bits} bits, 1 or 3 of 8 expected")
    return width, height
