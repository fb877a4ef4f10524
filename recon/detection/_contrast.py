"""A part of an image with its contrast evened out, as a cascade sees faces best."""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Box

__all__ = ["evened"]

# The brightness of what is at a face's depth is spread to the whole range: a wall behind it, or a
# lamp, is not to decide what is dark. Percentiles; and the least range that is spread.
_LOW, _HIGH = 2.0, 98.0
_LEAST_RANGE = 8.0
# Then tiles of so many pixels get contrast of their own (CLAHE, Zuiderveld, 1994).
_TILE_PX = (80, 60)
_CLIP = 4.0


def evened(
    gray: NDArray[np.uint8], part: Box, brightness: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Give an image with the contrast of a part of it evened out.

    Parameters
    ----------
    gray : (H, W) uint8
    part : x, y, width, height of it; inside the image
    brightness : (n,) uint8, that of what is wanted in it; all of the part where n is 0
    """
    x, y, width, height = part
    there = np.s_[y:y + height, x:x + width]
    dark, bright = np.percentile(brightness if len(brightness) else gray[there], (_LOW, _HIGH))
    spread = (np.arange(256) - dark) / max(bright - dark, _LEAST_RANGE)
    spread = np.rint(255 * np.clip(spread, 0, 1)).astype(np.uint8)
    tiles = [max(1, round(side / tile)) for side, tile in
             zip((width, height), _TILE_PX, strict=True)]
    out = gray.copy()
    out[there] = cv2.createCLAHE(clipLimit=_CLIP, tileGridSize=tiles).apply(spread[gray[there]])
    return out
