"""How a face's outline looks: tongues, islands, bays and pin-holes of its dense cloud."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud
from denseface.recon.numerics.morphology import binary_fill_holes

__all__ = ["NARROW_MM", "OutlineFaults", "outline_faults"]

NARROW_MM = 5.0
"""What is narrower is a tongue, or a bay."""
_REACH_MM = 2.0
"""How far at least it reaches: what a disc leaves of any corner is less."""
_FINE = 0.25
"""Step of the grid on which widths are measured, mm."""


class OutlineFaults(NamedTuple):
    """Counts, and their areas over (X, Y), mm^2."""

    tongues: int
    tongues_mm2: float
    islands: int
    bays: int
    bays_mm2: float
    holes: int
    holes_mm2: float


def outline_faults(cloud: DenseCloud) -> OutlineFaults:
    """Look at where a cloud has points, whatever their depth."""
    margin = 2 * int(NARROW_MM / cloud.grid_step_mm) + 2
    mask = np.zeros([side + 2 * margin for side in cloud.grid_shape], np.uint8)
    mask[cloud.cells[:, 0] + margin, cloud.cells[:, 1] + margin] = 1
    every = max(1, round(cloud.grid_step_mm / _FINE))
    mask = mask.repeat(every, axis=0).repeat(every, axis=1)
    step = cloud.grid_step_mm / every
    whole = binary_fill_holes(mask)
    tongues = _reaching(whole > _opened(whole, step), step)
    bays = _reaching(_opened(1 - whole, step) < 1 - whole, step)
    islands = cv2.connectedComponents(whole, connectivity=8)[0] - 2
    holes = cv2.connectedComponents(whole - mask, connectivity=8)[0] - 1
    return OutlineFaults(*tongues, islands, *bays, holes,
                         float(np.count_nonzero(whole - mask) * step**2))


def _opened(mask: NDArray[np.uint8], step: float) -> NDArray[np.uint8]:
    """Keep what discs within the mask cover."""
    radius = NARROW_MM / 2 / step
    middles = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > radius
    away = cv2.distanceTransform((~middles).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return (away <= radius).astype(np.uint8)


def _reaching(narrow: NDArray[np.bool_], step: float) -> tuple[int, float]:
    """Count the parts that are more than a corner, and add their areas, mm^2."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(narrow.astype(np.uint8), connectivity=8)
    sides = np.hypot(stats[1:, cv2.CC_STAT_WIDTH], stats[1:, cv2.CC_STAT_HEIGHT]) * step
    areas = stats[1:, cv2.CC_STAT_AREA] * step**2
    found = (sides > _REACH_MM) & (areas > _REACH_MM**2)
    return int(found.sum()), float(areas[found].sum())
