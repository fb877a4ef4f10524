"""Binary morphology: discs, holes, openings; the pixels of an image under a mask."""

import math
from functools import lru_cache
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Ints

__all__ = ["binary_fill_holes", "dilated", "disc", "enclosed_parts", "eroded",
           "large_components", "opened", "select_pixels", "select_values"]

_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
_Kind = TypeVar("_Kind", bound=np.generic)


def select_pixels(image: NDArray[_Kind], mask: Bools) -> NDArray[_Kind]:
    """Give `image[mask]`, (H, W, k) to (n, k), three times as fast."""
    return image.reshape(-1, image.shape[2]).take(np.flatnonzero(mask), axis=0)


def select_values(image: NDArray[_Kind], mask: Bools) -> NDArray[_Kind]:
    """Give `image[mask]`, (H, W) to (n,), three times as fast."""
    return image.reshape(-1).take(np.flatnonzero(mask))


def disc(radius: float) -> Bytes:
    """Give the pixels within a radius of the middle one, (k, k) uint8, for OpenCV's morphology."""
    return _disc(float(radius))


@lru_cache(maxsize=64)
def _disc(radius: float) -> Bytes:
    reach = int(radius)
    steps = np.arange(-reach, reach + 1)
    found = (steps[:, None] ** 2 + steps**2 <= radius * radius).astype(np.uint8)
    found.flags.writeable = False
    return found


def dilated(image: Bytes, radius: int) -> Bytes:
    """Dilate by an octagon of that radius, pixels: (H, W) uint8, 0 or 1, to the same.

    By a square and then by a lozenge, which together take half the time of a disc.
    """
    square, lozenge = _octagon(radius)
    return np.asarray(cv2.dilate(cv2.dilate(image, square), _CROSS, iterations=lozenge), np.uint8)


def eroded(image: Bytes, radius: int) -> Bytes:
    """Erode by the same; beyond the image's edge the area goes on."""
    square, lozenge = _octagon(radius)
    return np.asarray(cv2.erode(cv2.erode(image, square), _CROSS, iterations=lozenge), np.uint8)


def _octagon(radius: int) -> tuple[Bytes, int]:
    """Split a radius: a square, and so many times a cross."""
    square = round(radius * (math.sqrt(2) - 1))
    return np.ones((2 * square + 1, 2 * square + 1), np.uint8), radius - square


def binary_fill_holes(image: Bytes) -> Bytes:
    """Fill what is enclosed: (H, W) uint8, 0 or 1, to the same."""
    outside = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(outside, None, (0, 0), 2)
    return np.asarray(outside[1:-1, 1:-1] != 2, np.uint8)


def enclosed_parts(mask: Bools) -> tuple[Ints, Ints]:
    """Number the components, connected at sides or corners, and find those off the border.

    mask : (H, W)

    Returns
    -------
    labels : (H, W), 0 elsewhere
    parts : (k, 5), of each component that does not reach the border its label, left, top, width
        and height, pixels
    """
    # What reaches the border is mostly large: it is filled at once, and not measured.
    inner = cv2.copyMakeBorder(mask.view(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=1)
    cv2.floodFill(inner, None, (0, 0), 0, flags=8)
    labels = np.zeros(mask.shape, np.int32)
    left, top, width, height = cv2.boundingRect(inner)
    if not width:
        return labels, np.empty((0, 5), np.int32)
    count, inside, boxes, _ = cv2.connectedComponentsWithStats(
        inner[top:top + height, left:left + width], connectivity=8)
    labels[top - 1:top - 1 + height, left - 1:left - 1 + width] = inside
    parts = np.column_stack([np.arange(count), boxes[:, :4] + (left - 1, top - 1, 0, 0)])[1:]
    return labels, np.asarray(parts, np.int32)


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
    if np.count_nonzero(image) < least:
        return np.zeros_like(image)
    _, labels = cv2.connectedComponents(image.view(np.uint8), connectivity=8)
    large: Bools = np.bincount(labels.ravel()) >= least
    large[0] = False  # the background
    return large.take(np.asarray(labels, np.int32))
