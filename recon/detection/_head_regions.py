"""Where in the colour image depth looks like a head: the nearest places first."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
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
from denseface.recon.intermediate import NO_DEPTH_MM, Registration

_MIN_RADIUS_MM = 35.0
"""Head-like places that hang together are at least as large as a circle of that radius."""
_AROUND_MM = 20.0
"""How far about a head-like place the middle of a cascade's box may be."""
DEEPER_MM = 50.0
"""How far a face's middle may lie behind the nearest reading of its cell."""
_MOST_CELLS = 1e6
"""Cells to a millimetre at a distance of 1 mm; a Kinect has 72."""


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
        regions.append(Region(roi, near, far + DEEPER_MM, centers.view(np.bool_)))
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
