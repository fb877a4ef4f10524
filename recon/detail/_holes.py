"""Holes are filled by the surface of least bending energy.

Broad fits of heights spread a turn evenly over the hole, as a thin plate does: a chin's edge is
cut off. What a bent plate stores, the integral of its squared curvatures over its area, is
about (second differences)^2 / (1 + slope^2)^(5/2), so that a turn is where the surface is steep.
Sought is the least of that and of the squared residuals of the seeds around, on cells two
spacings wide; outside of a hole and its border the surface is given. Constants:
docs/decisions/0019.
"""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats, Ints
from denseface.recon.detail import _hole_kernels as kernels
from denseface.recon.detail._rim import Rim
from denseface.recon.numerics.filters import downsampled
from denseface.recon.numerics.lapack import dpbsv
from denseface.recon.numerics.morphology import large_components

_MISSING = 0.5
"""Cells of which a larger part is missing are a hole."""
_MIN_CELLS = 2
"""Fewer cells are none."""
_MIN_RIM_DISTANCE = 2.0
"""Cells nearer to the rim are none, mean spacings."""
_BORDER = 2
"""A hole's unknowns reach so many cells over its border."""
_SMOOTHING = 4.0
"""Weight of the bending against the seeds' squared residuals, lengths in mean spacings."""
_CELL = 2.0
"""Side of a cell, mean spacings."""
_ITERATIONS = 2
"""Solutions, each with the slopes of the one before."""


def fill_holes(
    counts: Floats, sums: Floats, missing: Floats, rim: Rim, heights: Floats, detail: Floats,
    spacing: float,
) -> tuple[Floats, Floats]:
    """Find the heights in holes.

    counts, sums : (rows, columns) float32, the seeds in each cell, two spacings wide, and the sum
        of what they are off the heights, mm
    missing : (4 rows, 4 columns) float32 or up to three fewer, 0-1, what part of the surface the
        seeds do not tell
    rim : of the surface, by half as many points each way as `missing`
    heights, detail : as `missing`, mm: a fit and what is added to it; in holes a first guess
    spacing : mean spacing of the seeds, mm

    Gives what is to be added to the heights there, mm, times how much of a place is filled, 0-1,
    and the latter: as `missing`, both 0 where there is no hole.
    """
    distance = downsampled(rim.distance)
    inside = distance > 0
    hole = large_components(
        (downsampled(downsampled(missing)) > _MISSING) & (distance > _MIN_RIM_DISTANCE), _MIN_CELLS)
    if not hole.any():
        none = np.zeros_like(missing)
        return none, none
    labels, boxes = _with_border(hole, inside)
    cells = kernels.Cells(
        counts, sums, downsampled(downsampled(heights)), downsampled(downsampled(detail)), inside,
        np.full(labels.shape, -1, np.int32))
    for label in range(1, len(boxes)):
        _minimize_bending(cells, labels, label, boxes[label], _CELL * spacing)
    return kernels.resample_filled(cells.added, labels, missing)


def _with_border(hole: Bools, inside: Bools) -> tuple[Ints, Ints]:
    """Number holes with their borders: labels, 0 elsewhere, and a box for each, (labels, 5)."""
    side = 2 * _BORDER + 1
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    wanted = np.asarray(cv2.dilate(hole.view(np.uint8), ellipse) * inside, np.uint8)
    wanted[:3] = wanted[-3:] = 0
    wanted[:, :3] = wanted[:, -3:] = 0
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(wanted)
    return np.asarray(labels, np.int32), np.asarray(boxes, np.int32)


def _minimize_bending(
    cells: kernels.Cells, labels: Ints, label: int, box: Ints, step: float
) -> None:
    """Set what is added in one hole; `step` is from cell to cell, mm."""
    rows, columns = kernels.number_unknowns(labels, label, box, cells.numbers)
    band = kernels.bandwidth(rows, columns, cells.numbers)
    for _ in range(_ITERATIONS):
        lower, right = kernels.normal_equations(
            cells, rows, columns, box, band, _SMOOTHING / _CELL**2, step)
        # The lower half by rows is the upper half by columns, as LAPACK has it. Called directly:
        # solveh_banded's checks take as long as a small hole's solution.
        _, cells.added[rows, columns], _ = dpbsv(lower.T, right, overwrite_ab=1, overwrite_b=1)
    cells.numbers[rows, columns] = -1
