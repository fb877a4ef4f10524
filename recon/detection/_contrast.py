"""The image that cascades search: grey and small; its contrast changed in the dark."""

import cv2
import numpy as np

from denseface.recon.arrays import Bytes
from denseface.recon.errors import NoFaceError
from denseface.recon.face import Box

_MAX_WIDTH_PX = 640
"""Wider images are shrunk: cascades were trained on faces of 20-24 pixels and gain nothing."""
_MIN_SIDE_PX = 20
"""No cascade's window is smaller."""
_LOW, _HIGH = 2.0, 98.0
"""Percentiles of the samples' brightness that become black and white."""
_MIN_RANGE = 8.0
"""Grey levels: a narrower range is stretched no further, so that noise stays small."""
_TILE_PX = (80, 60)
"""Width and height of CLAHE's tiles, pixels, about."""
_CLIP_LIMIT = 4.0
"""CLAHE's limit of contrast (Zuiderveld, 1994)."""


def gray_to_search(color: Bytes) -> Bytes:
    """Give the brightness of (H, W, 3) RGB, uint8, shrunk where the image is wide.

    Raises
    ------
    NoFaceError
        Where it is narrower, or lower, than any cascade's window.
    """
    height, width = color.shape[:2]
    shrink = min(1.0, _MAX_WIDTH_PX / width)
    if min(height, width) * shrink < _MIN_SIDE_PX:
        raise NoFaceError(f"no face found in a strip of {width}x{height} pixels")
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    if shrink < 1:
        gray = cv2.resize(gray, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return np.asarray(gray, np.uint8)


def equalize_contrast(gray: Bytes, roi: Box, samples: Bytes) -> Bytes:
    """Stretch a part of an image to the whole range of the samples, then apply CLAHE.

    The samples are what lies at a face's depth: neither a wall behind it nor a lamp then decides
    what is dark.

    Parameters
    ----------
    gray : (H, W) uint8
    roi : x, y, width, height of the part; inside the image
    samples : (n,) uint8, brightness; all of the part where n is 0

    Returns
    -------
    (H, W) uint8, unchanged outside the part
    """
    x, y, width, height = roi
    inside = np.s_[y:y + height, x:x + width]
    dark, bright = np.percentile(samples if len(samples) else gray[inside], (_LOW, _HIGH))
    stretch = (np.arange(256) - dark) / max(bright - dark, _MIN_RANGE)
    stretch = np.rint(255 * np.clip(stretch, 0, 1)).astype(np.uint8)
    tiles = [max(1, round(side / tile)) for side, tile in
             zip((width, height), _TILE_PX, strict=True)]
    out = gray.copy()
    out[inside] = cv2.createCLAHE(clipLimit=_CLIP_LIMIT, tileGridSize=tiles).apply(
        stretch[gray[inside]])
    return out


def lift_shadows(gray: Bytes) -> Bytes:
    """Give 255 times the square root of (H, W) uint8 brightness, as a share of 255.

    A cascade compares sums of brightness: the lit half of a face that is lit from the side
    outweighs all that is in the other.
    """
    levels = np.rint(255 * np.sqrt(np.arange(256) / 255)).astype(np.uint8)
    return np.asarray(levels[gray], np.uint8)
