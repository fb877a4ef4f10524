"""Colours of a texture where a mesh has its points."""

import struct

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.service.protocol.jpeg import jpeg_size

__all__ = ["sample"]

_MOST_PIXELS = 1 << 25
_PNG = b"\x89PNG\r\n\x1a\n"


def sample(image: bytes, uv: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Give the colours of a JPEG or PNG, bilinear.

    Parameters
    ----------
    uv : (n, 2), 0-1 from the image's upper left corner; beyond it, that of the edge counts

    Returns
    -------
    (n, 3) uint8, RGB

    Raises
    ------
    ValueError
        It is neither, damaged, or of more than 32 megapixels.
    """
    if image.startswith(_PNG) and len(image) >= 24:
        width, height = struct.unpack_from(">II", image, 16)
    else:
        width, height = jpeg_size(image)
    if not 0 < width * height <= _MOST_PIXELS:
        raise ValueError(f"its texture has {width} x {height} pixels, expected at most "
                         f"{_MOST_PIXELS}")
    try:
        found = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise ValueError("its texture is damaged") from error
    if found is None:
        raise ValueError("its texture is damaged")
    pixels = found[..., ::-1].astype(np.float32)
    last = np.array([pixels.shape[1] - 1, pixels.shape[0] - 1])
    place = np.clip(np.nan_to_num(uv) * (last + 1) - 0.5, 0, last)
    low = np.minimum(place.astype(int), np.maximum(last - 1, 0))
    high = np.minimum(low + 1, last)
    (u, v), (left, top), (right, bottom) = (place - low).T[:, :, None], low.T, high.T
    mixed = ((pixels[top, left] * (1 - u) + pixels[top, right] * u) * (1 - v)
             + (pixels[bottom, left] * (1 - u) + pixels[bottom, right] * u) * v)
    return np.asarray(np.rint(mixed), np.uint8)
