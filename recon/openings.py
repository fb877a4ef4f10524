"""What is left open in a face's surface, inside its outline."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools
from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.recon.numerics.morphology import binary_fill_holes, enclosed_parts

__all__ = ["Openings", "openings"]


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
    if _may_be_torn(cloud):
        depth = np.zeros(there.shape, np.float32)
        depth.ravel()[places] = cloud.points[:, 2]
        there[_torn(depth, there, MAX_STEP * cloud.grid_step_mm)] = 0
    if not (binary_fill_holes(there) - there).any():
        return Openings(0, (0.0, 0.0))
    _, boxes = enclosed_parts(there == 0)
    if not len(boxes):  # what was filled is open to the outside across a corner
        return Openings(0, (0.0, 0.0))
    sides = boxes[:, 3:5] * cloud.grid_step_mm
    width, height = sides[sides.max(axis=1).argmax()]
    return Openings(len(sides), (float(width), float(height)))


def _may_be_torn(cloud: DenseCloud) -> bool:
    """Say whether there are slopes that make such a step, along a diagonal."""
    least = 1 / np.sqrt(1 + MAX_STEP**2 / 2)
    return len(cloud) > 0 and bool(-cloud.normals[:, 2].max() < least)


def _torn(depth: np.ndarray, there: np.ndarray, limit: float) -> Bools:
    """Say which places are among four that are too far apart in depth."""
    block = np.ones((2, 2), np.uint8)
    whole = cv2.erode(there, block)
    step = cv2.dilate(depth, block) - cv2.erode(depth, block)
    # A block is kept at its last place: it takes its first ones along.
    torn = ((step > limit) & (whole > 0)).view(np.uint8)
    return np.asarray(cv2.dilate(torn, block, anchor=(0, 0)) > 0)
