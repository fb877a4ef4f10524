"""Binary images: discs and holes."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["disc", "fill_holes"]


def disc(radius: float) -> NDArray[np.uint8]:
    """Give the pixels within a radius of the middle one, (k, k) uint8, for OpenCV's morphology."""
    reach = int(radius)
    steps = np.arange(-reach, reach + 1)
    return (steps[:, None] ** 2 + steps**2 <= radius * radius).astype(np.uint8)


def fill_holes(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Fill what is enclosed: (H, W) uint8, 0 or 1, to the same."""
    outside = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(outside, None, (0, 0), 2)
    return np.asarray(outside[1:-1, 1:-1] != 2, np.uint8)
