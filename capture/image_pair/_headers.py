"""What an image file says of its size, before one pixel of it is decoded.

A file of a kilobyte may announce a picture of gigabytes. The decoders know no bound of ours, so
the header is read here first: PNG, JPEG, TIFF, WebP and OpenEXR.
"""

import struct
import zlib
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["ImageHeader", "read_header"]

_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of a JPEG that begin a frame (ITU-T T.81, table B.1)."""
_JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""Markers without a length after them."""
_TIFF_WIDTH, _TIFF_HEIGHT = 256, 257
"""Tags of the first directory (TIFF 6.0)."""
_TIFF_TYPES = {3: "H", 4: "I", 16: "Q"}
"""SHORT, LONG and BigTIFF's LONG8."""
_MOST_PARTS = 100_000
"""Chunks of a PNG or segments of a JPEG before its pixels; a picture of 256 MiB in chunks of 8 KiB
has a third of that."""
_MOST_TEXT = 256
"""Bytes of a name in an EXR header."""
_MOST_ENTRIES = 1024
"""Tags of a directory, attributes of an EXR header; files have a score."""
_EXR_ODD = {0x800: "deep data", 0x1000: "several parts"}
"""Bits of an EXR's version field."""


class ImageHeader(NamedTuple):
    """What a file is and how large a picture it announces, pixels."""

    kind: str
    width: int
    height: int


def read_header(data: bytes) -> ImageHeader:
    """Read the header of an image file that is in memory.

    Raises
    ------
    ValueError
        What is wrong with it, to be put after the file's name.
    """
    for magic, at, kind, size in _KINDS:
        if data[at:at + len(magic)] == magic:
            try:
                width, height = size(data)
            except (struct.error, IndexError) as error:
                raise ValueError(f"a {kind} image that ends within its header") from error
            if width < 1 or height < 1:
                raise ValueError(f"a {kind} image of {width}x{height} pixels")
            return ImageHeader(kind, width, height)
    raise ValueError(f"not an image: begins with {data[:8].hex(' ') or 'nothing'}, expected PNG, "
                     "TIFF, EXR, JPEG or WebP")


def _png(data: bytes) -> tuple[int, int]:
    if data[12:16] != b"IHDR":
        raise ValueError("a PNG image without IHDR")
    width, height = struct.unpack_from(">II", data, 16)
    at, kind = 8, b""
    for _ in range(_MOST_PARTS):
        if kind == b"IEND":
            return width, height
        if at + 12 > len(data):
            raise ValueError("a PNG image that is cut short (no IEND)")
        length, = struct.unpack_from(">I", data, at)
        kind, end = data[at + 4:at + 8], at + 8 + length
        # The decoder would complain of it on stderr by itself.
        if end + 4 > len(data) or zlib.crc32(data[at + 4:end]) != int.from_bytes(data[end:end + 4]):
            raise ValueError(f"a PNG image that is cut short or damaged at byte {at}")
        at = end + 4
    raise ValueError(f"a PNG image of more than {_MOST_PARTS} chunks")


def _jpeg(data: bytes) -> tuple[int, int]:
    at, size = 2, None
    for _ in range(_MOST_PARTS):
        if data[at] != 0xFF:
            raise ValueError(f"a JPEG image that is damaged at byte {at}")
        marker = data[at + 1]
        if marker == 0xFF:  # padding
            at += 1
            continue
        if marker == 0xDA:
            break
        if marker in _JPEG_FRAMES and size is None:
            height, width = struct.unpack_from(">HH", data, at + 5)
            size = width, height
        at += 2 if marker in _JPEG_ALONE else 2 + max(
            2, struct.unpack_from(">H", data, at + 2)[0])
    if size is None:
        raise ValueError("a JPEG image without a frame")
    # Within a scan 0xFF is followed by 0, so this is the end and no thumbnail's; without it the
    # decoder fills the rest with grey.
    if data.find(b"\xff\xd9", at) < 0:
        raise ValueError("a JPEG image that is cut short (no end of image)")
    return size


def _webp(data: bytes) -> tuple[int, int]:
    chunk = data[12:16]
    if chunk == b"VP8X":
        return (1 + int.from_bytes(data[24:27], "little"),
                1 + int.from_bytes(data[27:30], "little"))
    if chunk == b"VP8L":
        bits, = struct.unpack_from("<I", data, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if chunk == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    raise ValueError(f"a WebP image that begins with {chunk!r}")


def _tiff(order: str, big: bool) -> Callable[[bytes], tuple[int, int]]:
    def size(data: bytes) -> tuple[int, int]:
        at, = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)
        count, = struct.unpack_from(order + ("Q" if big else "H"), data, at)
        if count > _MOST_ENTRIES:
            raise ValueError(f"a TIFF image with {count} tags")
        at += 8 if big else 2
        entry = 20 if big else 12
        found = {}
        for number in range(count):
            tag, form = struct.unpack_from(order + "HH", data, at + number * entry)
            if tag in (_TIFF_WIDTH, _TIFF_HEIGHT) and form in _TIFF_TYPES:
                found[tag], = struct.unpack_from(
                    order + _TIFF_TYPES[form], data, at + number * entry + (12 if big else 8))
        if len(found) < 2:
            raise ValueError("a TIFF image without a size")
        return found[_TIFF_WIDTH], found[_TIFF_HEIGHT]

    return size


def _exr(data: bytes) -> tuple[int, int]:
    flags, = struct.unpack_from("<I", data, 4)
    for bit, what in _EXR_ODD.items():
        if flags & bit:
            raise ValueError(f"an EXR image with {what}, expected a single flat part")
    at, size = 8, None
    for _ in range(_MOST_ENTRIES):
        if data[at] == 0:
            break
        name_end = _end_of_text(data, at)
        type_end = _end_of_text(data, name_end + 1)
        length, = struct.unpack_from("<i", data, type_end + 1)
        if length < 0:
            raise ValueError("an EXR image with a damaged header")
        if data[at:name_end] == b"dataWindow":
            left, top, right, bottom = struct.unpack_from("<4i", data, type_end + 5)
            size = right - left + 1, bottom - top + 1
        at = type_end + 5 + length
    if size is None:
        raise ValueError("an EXR image without a size")
    return size


def _end_of_text(data: bytes, at: int) -> int:
    """Find the 0 that ends a text of a header."""
    end = data.find(0, at, at + _MOST_TEXT)
    if end < 0:
        raise ValueError(f"an EXR image with a damaged header (byte {at})")
    return end


_KINDS: tuple[tuple[bytes, int, str, Callable[[bytes], tuple[int, int]]], ...] = (
    (b"\x89PNG\r\n\x1a\n", 0, "PNG", _png),
    (b"\xff\xd8\xff", 0, "JPEG", _jpeg),
    (b"WEBP", 8, "WebP", _webp),
    (b"II*\0", 0, "TIFF", _tiff("<", big=False)),
    (b"MM\0*", 0, "TIFF", _tiff(">", big=False)),
    (b"II+\0", 0, "TIFF", _tiff("<", big=True)),
    (b"MM\0+", 0, "TIFF", _tiff(">", big=True)),
    (b"\x76\x2f\x31\x01", 0, "EXR", _exr),
)
"""First bytes, where they are, what the file is then, and how its size is read."""
