"""What is left open in a face's surface, inside its outline."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Floats, Ints
from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.recon.numerics.jit import compiled
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
    none = Openings(0, (0.0, 0.0))
    # Only slopes that make such a step, along a diagonal, tear a surface.
    there, torn_blocks, torn = _on_grid(
        cloud.cells, cloud.points, cloud.normals, *cloud.grid_shape,
        MAX_STEP * cloud.grid_step_mm, float(1 / np.sqrt(1 + MAX_STEP**2 / 2)))
    if not torn_blocks and not (binary_fill_holes(there) != there).any():
        return none
    _, parts = enclosed_parts(_uncovered(there, torn if torn_blocks else None))
    if not len(parts):
        return none
    # From point to point: places and what lies between count two to a step.
    sides = (parts[:, 3:5] + 1) / 2 * cloud.grid_step_mm
    width, height = sides[sides.max(axis=1).argmax()]
    return Openings(len(sides), (float(width), float(height)))


@compiled
def _on_grid(
    cells: Ints, points: Floats, normals: Floats, rows: int, columns: int, limit: float,
    steep: float,
) -> tuple[Bytes, int, Bools]:
    """Put a cloud on its grid, a place wider each way: 1 where a point is.

    limit : blocks of 2x2 places whose points are farther apart in depth are torn, mm
    steep : there are none where all points are turned to the camera by more (cosine)

    Gives also how many are torn, and which. Blocks of one or two points, of which no triangle is,
    never are.
    """
    there = np.zeros((rows + 2, columns + 2), np.uint8)
    depth = np.zeros((rows + 2, columns + 2), np.float32)
    least = np.float32(1)
    for i in range(len(cells)):
        down, right = np.uint32(cells[i, 0] + 1), np.uint32(cells[i, 1] + 1)
        there[down, right] = 1
        depth[down, right] = points[i, 2]
        least = min(least, -normals[i, 2])
    torn, count = np.zeros((rows + 1, columns + 1), np.bool_), 0
    if least >= steep:
        return there, count, torn
    for i in range(rows + 1):
        for j in range(columns + 1):
            if there[i, j] + there[i, j + 1] + there[i + 1, j] + there[i + 1, j + 1] < _CORNERS:
                continue
            low, high = np.float32(1e30), np.float32(-1e30)
            for row in range(i, i + 2):
                for column in range(j, j + 2):
                    if there[row, column]:
                        low = min(low, depth[row, column])
                        high = max(high, depth[row, column])
            if high - low > limit:
                torn[i, j] = True
                count += 1
    return there, count, torn


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
