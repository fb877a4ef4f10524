"""Which places look most like a head, by all that was read there: where dear passes are worth it.

`_heads` asks little of a place, since it asks every cell. Of what it leaves in rooms and on tables
most is told from a head by laying a mean face on the readings, in less time than a pass takes.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.jit import compiled

__all__ = ["LIKELY", "MAYBE", "HeadScore", "likeness"]

MAYBE, LIKELY = 0.1, 0.3
"""Scores of a place at which more than the first pass looks there, and the last ones. Of 171 faces
of simulated heads two have less than the second, lifted or lowered by 30 degrees; of 231 other
places in rooms, on tables and beside faces two thirds have less than the first."""

HeadScore = Callable[[Doubles], float]
"""How sure it is that points, (n, 3) mm, are of a face, 0-1."""

_REACH_MM = 110.0
"""About the middle of a head, seen from the camera."""
_NEARER_MM, _FARTHER_MM = 40.0, 110.0
"""What is nearer or farther by more than where middles can be is not of it."""
_WIDEST_MM = 240.0
"""Where middles can be farther apart than this two heads may hang together."""
_MOST = 400
"""Points are enough."""


def likeness(
    registered: Registration, centers: Bools, range_mm: tuple[float, float], cell_px: float,
    focal_px: float, score: HeadScore,
) -> float:
    """Give the best score of the places in which middles of heads can be.

    Parameters
    ----------
    registered : depth tied to an image; every k-th pixel is enough
    centers : (rows, columns), cells of that image, some of them True: where middles can be
    range_mm : in which these are
    cell_px, focal_px : side of a cell, and focal length, pixels of that image
    score : tells points of faces from others
    """
    near, far = range_mm
    to_mm = cell_px * math.sqrt(near * far) / focal_px
    rows, columns = np.nonzero(centers)
    best = 0.0
    middles = [(float(rows.mean()), float(columns.mean()))]
    for row, column in middles + _of_parts(rows, columns, _WIDEST_MM / to_mm):
        points = _points_about(
            registered.points, registered.pixels, registered.color_depth, registered.visible,
            ((column + 0.5) * cell_px, (row + 0.5) * cell_px), _REACH_MM / to_mm * cell_px,
            (near - _NEARER_MM, far + _FARTHER_MM))
        best = max(best, score(points[::max(1, len(points) // _MOST)]))
        if best >= LIKELY:
            break
    return best


def _of_parts(
    rows: NDArray[np.intp], columns: NDArray[np.intp], widest: float
) -> list[tuple[float, float]]:
    """Give the mean of each part of cells along the longer side, where that is longer."""
    along = columns if np.ptp(columns) >= np.ptp(rows) else rows
    first, length = along.min(), int(np.ptp(along)) + 1
    count = math.ceil(length / widest)
    parts = (along - first) * count // length
    if count < 2:
        return []
    return [(float(rows[parts == part].mean()), float(columns[parts == part].mean()))
            for part in np.unique(parts)]


@compiled
def _points_about(
    points: Floats, pixels: Floats, depth: Floats, visible: Bools, middle: tuple[float, float],
    reach: float, range_mm: tuple[float, float],
) -> Doubles:
    """Give the points of some depths that are seen about a place, (n, 3) mm.

    middle : (u, v); reach : pixels
    """
    found = np.empty((visible.size, 3))
    count = 0
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            if not visible[i, j] or not range_mm[0] < depth[i, j] < range_mm[1]:
                continue
            u, v = pixels[i, j, 0] - middle[0], pixels[i, j, 1] - middle[1]
            if u * u + v * v < reach * reach:
                for k in range(3):
                    found[count, k] = points[i, j, k]
                count += 1
    return found[:count].copy()
