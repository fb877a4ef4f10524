"""Holes are filled by the surface that bends least, as bending counts along the surface.

Broad fits of heights spread a turn evenly over the hole, as a thin plate does: a chin's edge is
cut off. What a bent plate stores, the integral of its squared curvatures over its area, is
about (second differences)^2 / (1 + slope^2)^(5/2), so that a turn is where the surface is steep.
Sought is the least of that and of the squared residuals of the seeds around, on cells two
spacings wide; outside of a hole and its border the surface is given.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detail._hole_kernels import interpolate_filled, minimize_bending
from denseface.recon.detail._rim import Rim
from denseface.recon.numerics.components import large_components
from denseface.recon.numerics.filters import downsampled

__all__ = ["fill_holes"]

Image = NDArray[np.float32]

# Cells of which so much is missing are a hole, of so many at least and so many spacings inside the
# rim; its border reaches so many cells farther.
_MISSING = 0.5
_LEAST_CELLS = 2
_FROM_RIM = 2.0
_BORDER = 2
# Of the bending, against the seeds' squared residuals; lengths are in mean spacings.
_SMOOTHING = 4.0
_CELL = 2.0


def fill_holes(
    counts: Image, sums: Image, missing: Image, rim: Rim, heights: Image, detail: Image,
    spacing: float,
) -> tuple[Image, Image]:
    """Find the heights in holes.

    Parameters
    ----------
    counts, sums : (rows, columns) float32, the seeds in each cell, two spacings wide, and the sum
        of what they are off the heights, mm
    missing : (4 rows, 4 columns) or up to three fewer, 0-1, what share of the surface the seeds
        do not tell
    rim : of the surface, by half as many points each way as `missing`
    heights, detail : as `missing`, mm: a fit and what is added to it; in holes a first guess
    spacing : mean spacing of the seeds, mm

    Returns
    -------
    filled : as `missing`, mm: what is to be added to the heights there, times
    hole : 0-1, how much of a place is filled; both 0 where there is no hole
    """
    away = downsampled(rim.away)
    inside = away > 0
    hole = large_components(
        (downsampled(downsampled(missing)) > _MISSING) & (away > _FROM_RIM), _LEAST_CELLS)
    if not hole.any():
        none = np.zeros_like(missing)
        return none, none
    side = 2 * _BORDER + 1
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    wanted = np.asarray(cv2.dilate(hole.view(np.uint8), ellipse) * inside, np.uint8)
    wanted[:3] = wanted[-3:] = 0
    wanted[:, :3] = wanted[:, -3:] = 0
    _, *found, _ = cv2.connectedComponentsWithStats(wanted)
    parts, boxes = (np.asarray(one, np.int32) for one in found)
    added = downsampled(downsampled(detail))
    minimize_bending(counts, sums, downsampled(downsampled(heights)), added, parts, boxes, inside,
               _SMOOTHING / _CELL**2, _CELL * spacing)
    return interpolate_filled(added, parts, missing)
