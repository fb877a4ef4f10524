"""Looks for faces over a part of an image, rolled and mirrored as wanted."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detection._haar import load_cascade, passing_boxes
from denseface.recon.face import Box

__all__ = ["Look", "Middles", "look_for_faces"]

# How much two boxes may differ to be of one face: OpenCV's own.
_ALIKE = 0.2


class Look(NamedTuple):
    """One way to look for faces in a part of an image."""

    cascade: str
    face_px: float
    """The part is shrunk until a face of ordinary size is about so wide; never enlarged."""
    scale_step: float = 1.1
    min_neighbors: int = 5
    roll: float = 0.0
    """Faces tipped clockwise by so many degrees are looked for."""
    mirrored: bool = False


class Middles(NamedTuple):
    """Where in an image the middle of a box may be."""

    wanted: NDArray[np.bool_]
    """(rows, columns), cells of the image."""
    side: float
    """Of a cell, pixels."""
    left: float = 0.0
    top: float = 0.0
    """Where the first cell begins, pixels, counted from the image's corner."""


def look_for_faces(
    gray: NDArray[np.uint8],
    part: Box,
    look: Look,
    ordinary: float,
    sizes: tuple[float, float],
    middles: Middles,
) -> list[Box]:
    """Find faces in a part of an image.

    Parameters
    ----------
    gray : (H, W) uint8
    part : x, y, width, height of what is searched; inside the image
    look : how
    ordinary : how wide a face of ordinary size is there, pixels of the image
    sizes : the smallest and the largest box, pixels of the image
    middles : where in the image a box's middle may be

    Returns
    -------
    Boxes in pixels of the image, upright whatever the roll: a rolled face's box is turned
    about its own middle.
    """
    x, y, width, height = part
    shrink = min(1.0, look.face_px / ordinary)
    small = np.ascontiguousarray(gray[y:y + height, x:x + width])
    if shrink < 1:
        columns, rows = max(1, round(width * shrink)), max(1, round(height * shrink))
        small = np.asarray(
            cv2.resize(small, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
    # From the part's own pixels to those of the image that the cascade sees, middles of pixels.
    across, down = small.shape[1] / width, small.shape[0] / height
    back = np.array([[1 / across, 0, x - 0.5 + 0.5 / across], [0, 1 / down, y - 0.5 + 0.5 / down]])
    if look.roll:
        small, turned_back = _turned(small, look.roll)
        back = back @ np.vstack([turned_back, (0, 0, 1)])
    if look.mirrored:
        small = np.ascontiguousarray(small[:, ::-1])
        back = back @ np.array([[-1, 0, small.shape[1] - 1], [0, 1, 0], [0, 0, 1]])
    to_cells = back.copy()
    to_cells[:, 2] += 0.5 - np.array((middles.left, middles.top))
    boxes = passing_boxes(small, load_cascade(look.cascade), sizes[0] * shrink, sizes[1] * shrink,
                          look.scale_step, middles.wanted, to_cells / middles.side)
    grouped, _ = cv2.groupRectangles(boxes, look.min_neighbors, _ALIKE)
    found = []
    for left, top, w, h in grouped:
        u, v = back @ (left + (w - 1) / 2, top + (h - 1) / 2, 1)
        wide, high = w / across, h / down
        found.append((round(u - (wide - 1) / 2), round(v - (high - 1) / 2),
                      round(wide), round(high)))
    return found


def _turned(
    image: NDArray[np.uint8], degrees: float
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Turn an image against the clock, whole; and give the (2, 3) way of its pixels back."""
    height, width = image.shape
    there = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, 1.0)
    c, s = abs(there[0, 0]), abs(there[0, 1])
    wide, high = int(np.ceil(width * c + height * s)), int(np.ceil(width * s + height * c))
    there[:, 2] += (wide - width) / 2, (high - height) / 2
    turned = cv2.warpAffine(image, there, (wide, high), flags=cv2.INTER_LINEAR,
                            borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(turned, np.uint8), np.asarray(cv2.invertAffineTransform(there), np.float64)
