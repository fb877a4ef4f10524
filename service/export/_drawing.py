"""Words, lines and PNG files: what pictures have in common."""

import struct
import zlib
from collections.abc import Mapping
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["BACKGROUND", "FAINT_INK", "INK", "png", "width", "write"]

BACKGROUND = (20, 22, 24)
"""RGB."""
INK, FAINT_INK = (236, 238, 240), (156, 162, 168)
"""RGB, of titles and of captions."""
_PNG_BEGINNING = 8 + 25
"""Bytes of signature and IHDR, after which chunks of text may stand."""
_FONT = cv2.FONT_HERSHEY_DUPLEX


def png(image: NDArray[np.uint8], texts: Mapping[str, str] = MappingProxyType({})) -> bytes:
    """Give an (H, W, 3) RGB image as a PNG file, with a chunk for each text by its name."""
    encoded, png = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not encoded:
        raise RuntimeError("OpenCV could not write the PNG")
    data = png.tobytes()
    return data[:_PNG_BEGINNING] + b"".join(
        _text_chunk(name, text) for name, text in texts.items()) + data[_PNG_BEGINNING:]


def _text_chunk(name: str, text: str) -> bytes:
    """Give a text in UTF-8, of no language, not compressed (PNG, section 11.3.3.4)."""
    chunk = b"iTXt" + name.encode() + bytes(5) + text.encode("utf-8", "replace")
    return struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))


def write(canvas: NDArray[np.uint8], text: str, at: tuple[int, int], size: float,
          ink: tuple[int, int, int]) -> None:
    """Write a line of ASCII, its left lower corner at (x, y)."""
    cv2.putText(canvas, text, at, _FONT, size, ink, 1, cv2.LINE_AA)


def width(text: str, size: float) -> int:
    """Give how wide a line is, pixels."""
    (wide, _), _ = cv2.getTextSize(text, _FONT, size, 1)
    return int(wide)
