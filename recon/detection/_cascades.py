"""A pass of a Haar cascade over a part of an image, rotated and mirrored as wanted."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles
from denseface.recon.detection._haar import load_cascade, passing_boxes
from denseface.recon.face import Box

_GROUP_EPS = 0.2
"""How much boxes of one face may differ, as a share of their size: OpenCV's default."""


_WHOLE = 1e-6
"""A side that is larger than a whole number of pixels by no more is of so many."""


class CascadePass(NamedTuple):
    """Which cascade runs, at which resolution, in which orientation."""

    cascade: str
    face_px: float
    """The part is shrunk until a typical face is about this wide; never enlarged."""
    scale_step: float = 1.1
    min_neighbors: int = 5
    roll: float = 0.0
    """Finds faces that are tipped clockwise by this angle, degrees."""
    mirrored: bool = False


class CenterMask(NamedTuple):
    """Where in an image the centre of a box may be."""

    allowed: Bools
    """(rows, columns), cells of the image."""
    cell_px: float
    """Side of a cell, pixels."""
    left: float = 0.0
    top: float = 0.0
    """The upper left cell's corner, pixels from the image's corner."""


class Seen(NamedTuple):
    """One box that a pass found."""

    box: Box
    """Pixels of the image, upright whatever the roll: a rolled face's box is turned about its own
    centre."""
    windows: int
    """How many windows that passed it stands for."""


def run_pass(
    gray: Bytes, roi: Box, cascade_pass: CascadePass, typical_px: float,
    size_limits: tuple[float, float], centers: CenterMask,
) -> list[Seen]:
    """Find faces in a part of an image.

    Parameters
    ----------
    gray : (H, W) uint8
    roi : x, y, width, height of the part; inside the image
    typical_px : width of a typical face in it, pixels of the image
    size_limits : widths of the smallest and the largest box, pixels of the image
    centers : where in the image a box's centre may be
    """
    x, y, width, height = roi
    shrink = min(1.0, cascade_pass.face_px / typical_px)
    small = np.ascontiguousarray(gray[y:y + height, x:x + width])
    if shrink < 1:
        size = max(1, round(width * shrink)), max(1, round(height * shrink))
        small = np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_AREA), np.uint8)
    scale_x, scale_y = small.shape[1] / width, small.shape[0] / height
    # From pixels that the cascade sees to pixels of `gray`; whole numbers are pixel centres.
    to_image = np.array([[1 / scale_x, 0, x - 0.5 + 0.5 / scale_x],
                         [0, 1 / scale_y, y - 0.5 + 0.5 / scale_y]])
    if cascade_pass.roll:
        small, back = _rotated(small, cascade_pass.roll)
        to_image = to_image @ np.vstack([back, (0, 0, 1)])
    if cascade_pass.mirrored:
        small = np.ascontiguousarray(small[:, ::-1])
        to_image = to_image @ np.array([[-1, 0, small.shape[1] - 1], [0, 1, 0], [0, 0, 1]])
    to_cells = to_image.copy()
    to_cells[:, 2] += 0.5 - np.array((centers.left, centers.top))
    boxes = passing_boxes(small, load_cascade(cascade_pass.cascade),
                          (size_limits[0] * shrink, size_limits[1] * shrink),
                          cascade_pass.scale_step, centers.allowed, to_cells / centers.cell_px)
    grouped, counts = cv2.groupRectangles(boxes, cascade_pass.min_neighbors, _GROUP_EPS)
    found = []
    for (left, top, w, h), windows in zip(grouped, np.ravel(counts), strict=True):
        u, v = to_image @ (left + (w - 1) / 2, top + (h - 1) / 2, 1)
        box_width, box_height = w / scale_x, h / scale_y
        box = (round(u - (box_width - 1) / 2), round(v - (box_height - 1) / 2),
               round(box_width), round(box_height))
        found.append(Seen(box, int(windows)))
    return found


def _rotated(image: Bytes, degrees: float) -> tuple[Bytes, Doubles]:
    """Rotate a whole image counterclockwise; give also the (2, 3) transform of its pixels back."""
    height, width = image.shape
    transform = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, 1.0)
    c, s = abs(transform[0, 0]), abs(transform[0, 1])
    columns, rows = (int(np.ceil(side - _WHOLE)) for side in
                     (width * c + height * s, width * s + height * c))
    transform[:, 2] += (columns - width) / 2, (rows - height) / 2
    rotated = cv2.warpAffine(image, transform, (columns, rows), flags=cv2.INTER_LINEAR,
                             borderMode=cv2.BORDER_REPLICATE)
    return (np.asarray(rotated, np.uint8),
            np.asarray(cv2.invertAffineTransform(transform), np.float64))
