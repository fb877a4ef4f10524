"""A head by its depth alone: where there is no colour, or colour shows no face."""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.detection import judge_box
from denseface.recon.face import FaceCandidate
from denseface.recon.intermediate import Registration

_STEP_MM = 60.0
"""Neighbouring pixels whose depth differs by more are not of one thing."""
_TO_MIDDLE_MM = 115.0
"""From the top of a head to the middle of its face."""
_FACE_ROWS_MM = (40.0, 180.0)
"""Below the top: the rows whose middle is the face's."""
_WIDTHS_MM = (100.0, 290.0)
"""How wide those rows are: a child's head to one with much hair."""
_BOX_MM = 160.0
"""Width of the box, as a cascade's around an adult."""
_MIN_ROW_MM = 50.0
"""A row that is narrower is not the top of a head yet: hair, or noise."""


def heads_by_depth(
    registered: Registration, focal_px: float, farthest_mm: float
) -> list[FaceCandidate]:
    """Find the tops of connected things that have a head's width and bulge, the nearest first.

    Parameters
    ----------
    registered : every k-th pixel of the depth, tied to the colour image
    focal_px : focal length of the colour camera, pixels
    farthest_mm : what is farther is left out

    Returns
    -------
    boxes in pixels of the colour image; at most one for each thing
    """
    z = registered.color_depth
    near = registered.visible & (z <= farthest_mm)
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(
        _without_edges(near, z).view(np.uint8), connectivity=4)
    step = registered.rows.step or 1
    heads = []
    for piece in range(1, len(stats)):
        x, y, w, h, pixels = stats[piece].tolist()
        part = np.s_[y:y + h, x:x + w]
        inside = pieces[part] == piece
        pitch = float(np.median(z[part][inside])) * step / registered.focal_px
        if pixels * pitch**2 < _BOX_MM * _WIDTHS_MM[0]:
            continue
        box = _face_box(registered, (y, x), inside, pitch, focal_px)
        if box is not None:
            judged = judge_box(box, registered, focal_px)
            if judged.verdict == "face":
                heads.append(judged)
    return sorted(heads, key=lambda head: head.depth_mm or np.inf)


def _without_edges(near: Bools, z: Floats) -> Bools:
    """Clear the pixels at which depth steps, so that a head parts from a wall behind it."""
    kept = near.copy()
    for axis in (0, 1):
        step = np.abs(np.diff(z, axis=axis)) > _STEP_MM
        if axis == 0:
            kept[1:] &= ~step
        else:
            kept[:, 1:] &= ~step
    return kept


def _face_box(
    registered: Registration, corner: tuple[int, int], inside: Bools, pitch: float, focal_px: float
) -> tuple[int, int, int, int] | None:
    """Give the box of the face beneath the top of one thing.

    corner : row and column of the thing's upper left corner
    inside : (rows, columns), its pixels
    pitch : distance of pixels on it, mm
    """
    wide = np.flatnonzero(inside.sum(axis=1) * pitch >= _MIN_ROW_MM)
    if not len(wide):
        return None
    top = int(wide[0])
    first, past = (top + round(mm / pitch) for mm in _FACE_ROWS_MM)
    rows = inside[first:past]
    counts = rows.sum(axis=1)
    if not len(rows) or not _WIDTHS_MM[0] <= float(np.median(counts)) * pitch <= _WIDTHS_MM[1]:
        return None
    middle = int(np.median(np.nonzero(rows)[1]))
    row = min(top + round(_TO_MIDDLE_MM / pitch), len(inside) - 1)
    # The reading nearest to the middle of the face says where the colour camera sees it.
    at_row, at_column = np.nonzero(inside[first:past])
    nearest = int(np.argmin((at_row + first - row) ** 2 + (at_column - middle) ** 2))
    place = corner[0] + first + int(at_row[nearest]), corner[1] + int(at_column[nearest])
    u, v = registered.pixels[place]
    side = _BOX_MM * focal_px / float(registered.color_depth[place])
    return round(float(u) - side / 2), round(float(v) - side / 2), round(side), round(side)
