"""Where in the colour image depth looks like a head: the nearest places first, or the likeliest.

`_heads` asks little of a place, since it asks every cell. Of what it leaves in rooms and on tables
most is told from a head by laying a mean face on the readings, in less time than a pass takes.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.detection._heads import head_like
from denseface.recon.detection._regions import (
    CELLS,
    FARTHEST_MM,
    HALF_NARROWEST_MM,
    HALF_WIDEST_MM,
    NEAREST_MM,
    Region,
    nearest_by_cell,
    padded,
)
from denseface.recon.face import Box
from denseface.recon.intermediate import NO_DEPTH_MM, Registration
from denseface.recon.numerics.jit import compiled

_MIN_RADIUS_MM = 35.0
"""Head-like places that hang together are at least as large as a circle of that radius."""
_AROUND_MM = 20.0
"""How far about a head-like place the middle of a cascade's box may be."""
_DEEPER_MM = 50.0
"""How far a face's middle may lie behind the nearest reading of its cell."""
_MOST_CELLS = 1e6
"""Cells to a millimetre at a distance of 1 mm; a Kinect has 72."""

MAYBE, LIKELY = 0.1, 0.3
"""Scores of a place at which more than the first pass looks there, and the last ones. Of 171 faces
of simulated heads two have less than the second, lifted or lowered by 30 degrees; of 231 other
places in rooms, on tables and beside faces two thirds have less than the first."""

_REACH_MM = 110.0
"""About the middle of a head, seen from the camera."""
_NEARER_MM, _FARTHER_MM = 40.0, 110.0
"""What is nearer or farther by more than where middles can be is not of it."""
_WIDEST_MM = 240.0
"""Where middles can be farther apart than this two heads may hang together."""
_MOST = 400
"""Points are enough."""
HeadScore = Callable[[Doubles], float]
"""How sure it is that points, (n, 3) mm, are of a face, 0-1."""


class DepthCells(NamedTuple):
    """The nearest depth in each cell of the colour image."""

    nearest: Floats
    """(rows, CELLS), mm, or `NO_DEPTH_MM`."""
    shape: tuple[int, int]
    """Rows and columns of the image."""
    focal_px: float
    """Its focal length."""

    @property
    def cell_px(self) -> float:
        """Side of a cell."""
        return self.shape[1] / CELLS


def depth_cells(
    registered: Registration, shape: tuple[int, int], focal_px: float
) -> DepthCells:
    """Judge the depth of each cell of the colour image.

    Parameters
    ----------
    registered : the depth tied to the colour image; every k-th pixel is enough
    shape : rows and columns of the colour image
    focal_px : its focal length, pixels

    Raises
    ------
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    nearest = nearest_by_cell(registered, shape)
    # A cell that no reading fell into is as its neighbours.
    around = cv2.erode(nearest, np.ones((3, 3), np.uint8))
    return DepthCells(np.where(nearest == NO_DEPTH_MM, around, nearest), shape, focal_px)


def head_regions(cells: DepthCells, nearer_than_mm: float = FARTHEST_MM) -> list[Region]:
    """Give each place that depth allows for a head, the nearest first, up to a depth."""
    nearest, shape, focal_px = cells
    cell = cells.cell_px
    farthest = min(nearer_than_mm, FARTHEST_MM)
    # An absurd calibration leads out of any image, too, but in numbers.
    cells_at_1_mm = min(focal_px / cell, _MOST_CELLS)
    likely = head_like(nearest, cells_at_1_mm, NEAREST_MM, farthest)
    _clear_border(likely, nearest, cells_at_1_mm)
    count, labels, pieces, _ = cv2.connectedComponentsWithStats(
        likely.view(np.uint8), connectivity=8)
    regions = []
    for piece in range(1, count):
        middles = labels == piece
        depths = nearest[middles]
        near, far = float(depths.min()), float(depths.max())
        cells_to_mm = focal_px / cell / np.sqrt(near * far)
        if pieces[piece, cv2.CC_STAT_AREA] < np.pi * (_MIN_RADIUS_MM * cells_to_mm) ** 2:
            continue
        grown = 2 * round(_AROUND_MM * cells_to_mm) + 1
        centers = cv2.dilate(middles.view(np.uint8), np.ones((grown, grown), np.uint8))
        margin = int(np.ceil(HALF_WIDEST_MM * focal_px / near / cell))
        roi = padded(cv2.boundingRect(centers), margin, cell, shape)
        regions.append(Region(roi, near, far + _DEEPER_MM, centers.view(np.bool_)))
    return sorted(regions, key=lambda region: region.near_mm)


def largest(regions: list[Region], count: int) -> list[Region]:
    """Keep so many of the places with most room for the middle of a face; their order stays."""
    areas = [-np.count_nonzero(region.centers) * region.near_mm * region.far_mm
             for region in regions]
    return [regions[which] for which in sorted(np.argsort(areas)[:count])]


def _clear_border(likely: Bools, nearest: Floats, cells_at_1_mm: float) -> None:
    """Clear where the narrowest face would not be whole within the image."""
    half = HALF_NARROWEST_MM * cells_at_1_mm / nearest
    rows, columns = np.ogrid[:likely.shape[0], :likely.shape[1]]
    likely &= ((rows + 0.5 >= half) & (likely.shape[0] - rows - 0.5 >= half)
               & (columns + 0.5 >= half) & (likely.shape[1] - columns - 0.5 >= half))


class Likely:
    """Which places are likely to be a head, each scored once and not before it is asked for."""

    def __init__(
        self, registered: Registration, cells: DepthCells, score: HeadScore | None
    ) -> None:
        self._registered = registered
        self._cells = cells
        self._score = score
        self._known: dict[tuple[Box, float, float, float], float] = {}

    def of(
        self, regions: list[Region], least: float, nearer_than_mm: float = np.inf
    ) -> list[Region]:
        """Keep the places whose score is at least so much; all where there is no score.

        nearer_than_mm : only what is so near counts
        """
        if self._score is None or least <= 0:
            return regions
        kept = []
        for region in regions:
            key = (region.roi, region.near_mm, region.far_mm, nearer_than_mm)
            if key not in self._known:
                middles = region.near_mm, min(region.far_mm - _DEEPER_MM, nearer_than_mm)
                self._known[key] = likeness(
                    self._registered, region.centers, middles, self._cells.cell_px,
                    self._cells.focal_px, self._score)
            if self._known[key] >= least:
                kept.append(region)
        return kept


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
