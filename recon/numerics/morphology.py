"""Binary morphology: discs, holes, openings; the pixels of an image under a mask."""

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes

__all__ = ["binary_fill_holes", "disc", "large_components", "opened", "select_pixels"]

_Kind = TypeVar("_Kind", bound=np.generic)


def select_pixels(image: NDArray[_Kind], mask: Bools) -> NDArray[_Kind]:
    """Give `image[mask]`, (H, W, k) to (n, k), three times as fast."""
    return image.reshape(-1, image.shape[2]).take(np.flatnonzero(mask), axis=0)


def disc(radius: float) -> Bytes:
    """Give the pixels within a radius of the middle one, (k, k) uint8, for OpenCV's morphology."""
    reach = int(radius)
    steps = np.arange(-reach, reach + 1)
    return (steps[:, None] ** 2 + steps**2 <= radius * radius).astype(np.uint8)


def binary_fill_holes(image: Bytes) -> Bytes:
    """Fill what is enclosed: (H, W) uint8, 0 or 1, to the same."""
    outside = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(outside, None, (0, 0), 2)
    return np.asarray(outside[1:-1, 1:-1] != 2, np.uint8)


def opened(image: Bytes, radius: float) -> Bytes:
    """Keep what a disc of that radius, pixels, covers without leaving the area.

    (H, W) uint8, 0 or 1, to the same; beyond the image's edge the area goes on. By distances: for
    large discs that is many times faster than OpenCV's morphology.
    """
    middles = cv2.distanceTransform(image, cv2.DIST_L2, cv2.DIST_MASK_5) > radius
    if not middles.any():
        return np.zeros_like(image)
    away = cv2.distanceTransform((~middles).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return (away <= radius).astype(np.uint8)


def large_components(image: Bools, least: float) -> Bools:
    """Keep the components, connected at sides or corners, of at least so many pixels."""
    _, labels = cv2.connectedComponents(image.view(np.uint8), connectivity=8)
    large: Bools = np.bincount(labels.ravel()) >= least
    large[0] = False  # the background
    return large.take(np.asarray(labels, np.int32))
