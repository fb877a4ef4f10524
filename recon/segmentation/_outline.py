"""The outline of a face in the depth image: no frayed edge, no strand of hair.

All of it by morphology in millimetres.
"""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes
from denseface.recon.numerics.morphology import binary_fill_holes, opened

_BAY_MM = 16.0
"""Narrower bays of the outline are unmeasured spots at its edge, and are closed."""
_SPUR_MM = 30.0
"""Narrower parts of a face are ear, hair, or the frayed edge of depth, and are dropped."""
_TONGUE_MM = 5.0
"""And narrower ones of what is left without closed bays: hair of which a few readings remain."""
_ISLAND_SHARE = 0.15
"""Parts cut off from the largest are dropped below this share of its area: an ear, or hair."""
_SPARSE_MM, _SPARSE = 12.0, 0.45
"""Where a smaller part of such a square was measured, it is hair, if nothing encloses it."""
_MOSTLY = 0.6
"""Where less of the whole was measured, that tells nothing."""
_BLOCK = np.ones((2, 2), np.uint8)


def smooth_outline(
    face: Bools, other: Bools, middle: tuple[int, int], ear_px: float, px_per_mm: float
) -> Bools:
    """Give the face's area without spurs, tongues and islands, (H, W).

    Parameters
    ----------
    face : (H, W), with what hides parts of it
    other : (H, W), measured, but not of the face: at a depth edge the sensor sets pixels to either
        side
    middle : (row, column)
    ear_px : within so many rows of the middle, and farther aside, bays stay open
    """
    side = 2 * round(_BAY_MM * px_per_mm / 2) + 1
    closed = cv2.morphologyEx(
        face.view(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8)).view(bool)
    top, left, bottom, right = (max(round(place + way), 0) for way in (-ear_px, ear_px)
                                for place in middle)
    closed[top:bottom, :left] = closed[top:bottom, right:] = False
    # Half the pixels each way: so much detail is enough, in a fourth of the time.
    px_per_mm /= 2
    area = _broad_parts(_halved(solid(face | (closed & ~other))), _SPUR_MM * px_per_mm)
    if np.count_nonzero(face) > _MOSTLY * 4 * np.count_nonzero(area):
        read = _halved(face.view(np.uint8))
        read[~area | _sparse(face, area, px_per_mm)] = 0
        area = _broad_parts(binary_fill_holes(read), _TONGUE_MM * px_per_mm)
    return np.asarray(area.repeat(2, axis=0).repeat(2, axis=1)[:face.shape[0], :face.shape[1]])


def solid(face: Bools) -> Bytes:
    """Give the face's area with its holes filled, (H, W) uint8, 0 or 1."""
    closed = cv2.morphologyEx(face.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return binary_fill_holes(np.asarray(closed, np.uint8))


def _halved(mask: Bytes) -> Bytes:
    """Say which blocks of 2x2 pixels are not empty."""
    return np.asarray(cv2.dilate(mask, _BLOCK, anchor=(0, 0))[::2, ::2], np.uint8, order="C")


def _broad_parts(mask: Bytes, width: float) -> Bools:
    """Open a mask, 0 or 1, by a disc of that width, pixels; without its small parts."""
    _, parts = cv2.connectedComponents(opened(mask, width / 2), connectivity=4)
    areas = np.bincount(parts.ravel())
    areas[0] = 0
    return np.asarray(((areas > 0) & (areas >= _ISLAND_SHARE * areas.max()))[parts])


def _sparse(face: Bools, area: Bools, px_per_mm: float) -> Bools:
    """Say in which blocks little of the area around them was measured.

    face : (H, W), pixels; area : its blocks, and px_per_mm is theirs
    """
    side = 2 * round((_SPARSE_MM * px_per_mm - 1) / 2) + 1
    # The windows cover the same: the face's has its middle between the pixels of a block.
    measured = cv2.blur(face.view(np.uint8) * np.uint8(255), (2 * side, 2 * side),
                        anchor=(side - 1, side - 1), borderType=cv2.BORDER_CONSTANT)[::2, ::2]
    whole = cv2.blur(area.view(np.uint8) * np.uint8(255), (side, side),
                     borderType=cv2.BORDER_CONSTANT)
    return np.asarray(measured < np.float32(_SPARSE) * whole)
