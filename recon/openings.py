"""What is left open in a face's surface, inside its outline."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Floats
from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.recon.numerics.morphology import binary_fill_holes, enclosed_parts

__all__ = ["Openings", "openings"]


_CORNERS = 3
"""Of a triangle."""


class Openings(NamedTuple):
    """Holes in the surface that a cloud's triangles make."""

    holes: int
    largest_mm: tuple[float, float]
    """Width and height over (X, Y) of the longest; zero where there is none."""


def openings(cloud: DenseCloud) -> Openings:
    """Find holes: points all around, and inside none, or some that are a step apart in depth."""
    rows, columns = cloud.grid_shape[0] + 2, cloud.grid_shape[1] + 2
    places = cloud.cells[:, 0] * columns + cloud.cells[:, 1] + (columns + 1)
    there = np.zeros((rows, columns), np.uint8)
    there.ravel()[places] = 1
    torn = None
    if _may_be_torn(cloud):
        depth = np.zeros(there.shape, np.float32)
        depth.ravel()[places] = cloud.points[:, 2]
        torn = _torn(depth, MAX_STEP * cloud.grid_step_mm)
    elif not (binary_fill_holes(there) - there).any():
        return Openings(0, (0.0, 0.0))
    _, parts = enclosed_parts(_uncovered(there, torn))
    if not len(parts):
        return Openings(0, (0.0, 0.0))
    # From point to point: places and what lies between count two to a step.
    sides = (parts[:, 3:5] + 1) / 2 * cloud.grid_step_mm
    width, height = sides[sides.max(axis=1).argmax()]
    return Openings(len(sides), (float(width), float(height)))


def _may_be_torn(cloud: DenseCloud) -> bool:
    """Say whether there are slopes that make such a step, along a diagonal."""
    least = 1 / np.sqrt(1 + MAX_STEP**2 / 2)
    return len(cloud) > 0 and bool(-cloud.normals[:, 2].max() < least)


def _torn(depth: Floats, limit: float) -> Bools:
    """Say which blocks of 2x2 places are too far apart in depth: (rows - 1, columns - 1)."""
    block = np.ones((2, 2), np.uint8)
    return np.asarray((cv2.dilate(depth, block) - cv2.erode(depth, block) > limit)[1:, 1:])


def _uncovered(there: Bytes, torn: Bools | None) -> Bools:
    """Say where no triangle is: at places, half-way between two, and in the middle of blocks.

    (rows, columns), which of the places have a point, to (2 rows - 1, 2 columns - 1). Three points
    of a block make a triangle.
    """
    block = there[:-1, :-1] + there[:-1, 1:] + there[1:, :-1] + there[1:, 1:]
    covered = np.zeros((2 * there.shape[0] - 1, 2 * there.shape[1] - 1), np.uint8)
    joined = block >= _CORNERS if torn is None else (block >= _CORNERS) & ~torn
    covered[1::2, 1::2] = joined
    # What touches a triangle's middle and has a point at each end is the triangle's, too.
    covered = np.asarray(cv2.dilate(covered, np.ones((3, 3), np.uint8)), np.uint8)
    covered[::2, ::2] &= there
    covered[::2, 1::2] &= there[:, :-1] & there[:, 1:]
    covered[1::2, ::2] &= there[:-1] & there[1:]
    covered[1::2, 1::2] = joined
    return np.asarray(covered == 0)
