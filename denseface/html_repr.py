"""What a notebook shows of a thing: small pictures, and a table of what is asked for first."""

import base64
import struct
import zlib
from collections.abc import Iterable
from html import escape

import numpy as np
from numpy.typing import NDArray

__all__ = ["PICTURE_SIDE", "html_repr", "png"]

PICTURE_SIDE = 144
"""Longest side of a picture, pixels: two have less than 100 kB as text."""
_MAX_TEXT, _MAX_ROWS = 200, 24
"""Characters of a text, and lines, that are shown: they may come from a file."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def html_repr(
    title: str, rows: Iterable[tuple[str, str]], pictures: Iterable[tuple[str, NDArray[np.uint8]]],
) -> str:
    """Give HTML that stands by itself: no script, no style sheet, nothing that is fetched.

    Parameters
    ----------
    title : what the thing is
    rows : name and value; those without a value are left out. All are escaped.
    pictures : what is seen, and (h, w, 3) or (h, w, 4) uint8, RGB or RGBA
    """
    images = "".join(
        f'<img alt="{escape(name)}" title="{escape(name)}" '
        f'src="data:image/png;base64,{base64.b64encode(png(picture)).decode()}">'
        for name, picture in pictures)
    shown = [(name, value) for name, value in rows if value][:_MAX_ROWS]
    cells = "".join(
        f'<tr><td style="text-align:left">{_text(name)}</td>'
        f'<td style="text-align:left">{_text(value)}</td></tr>' for name, value in shown)
    return (f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:center">{images}'
            f"<div><strong>{_text(title)}</strong><table>{cells}</table></div></div>")


def png(image: NDArray[np.uint8]) -> bytes:
    """Give a PNG file of an image, (h, w, 3) or (h, w, 4) uint8 (ISO/IEC 15948).

    Without a library: a client with three packages has none that writes pictures.
    """
    height, width, channels = image.shape
    # Each line begins with the number of its filter: none.
    lines = np.zeros((height, 1 + width * channels), np.uint8)
    lines[:, 1:] = image.reshape(height, -1)
    kind = {3: 2, 4: 6}[channels]
    return b"".join([
        _SIGNATURE, _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)),
        _chunk(b"IDAT", zlib.compress(lines.tobytes(), 6)), _chunk(b"IEND", b"")])


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def _text(text: str) -> str:
    cut = text if len(text) <= _MAX_TEXT else f"{text[:_MAX_TEXT - 3]}..."
    return escape(cut if cut.isprintable() else ascii(cut)[1:-1])
