"""Where in the colour image a face can be, by depth: the nearest places first."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import NoDepthError
from recon.face import Box
from recon.registration import Registration

__all__ = ["Region", "regions_by_depth"]

# A face farther away has under 2,000 depth pixels and noise of over 5 mm: no face worth having.
_NEAREST_MM, _FARTHEST_MM = 300.0, 2000.0
_LAYERS = 7
# Cells of the colour image, so many across, in which depth is looked at.
_CELLS = 80
# A piece of a layer that is smaller, both ways, can not hold a face.
_LEAST_MM = 90.0
# A face's middle is in the layer, its sides may be in the next.
_HALF_FACE_MM = 90.0


class Region(NamedTuple):
    """A part of the colour image in which something lies between two depths."""

    part: Box
    near_mm: float
    far_mm: float


def regions_by_depth(
    registered: Registration, shape: tuple[int, int], focal_px: float
) -> list[Region]:
    """Cut the scene into layers of depth, and each layer into what hangs together in the image.

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
    if not (registered.color_depth > 0).any():
        raise NoDepthError("no depth lies before the colour camera: is the calibration right?")
    z = registered.color_depth[registered.visible]
    edges = np.geomspace(_NEAREST_MM, _FARTHEST_MM, _LAYERS + 1)
    layer = np.searchsorted(edges, z) - 1
    cell = shape[1] / _CELLS
    rows, columns = (int(np.ceil(side / cell)) for side in shape)
    column, row = ((registered.pixels[registered.visible].T + 0.5) / cell).astype(np.int64)
    regions = []
    for k in range(_LAYERS):
        inside = layer == k
        if not inside.any():
            continue
        near, far = float(edges[k]), float(edges[k + 1])
        filled = np.zeros((rows, columns), np.uint8)
        filled[np.clip(row[inside], 0, rows - 1), np.clip(column[inside], 0, columns - 1)] = 1
        for part in _pieces(filled, _LEAST_MM * focal_px / far / cell):
            around = round(_HALF_FACE_MM * focal_px / near / cell)
            regions.append(Region(_widened(part, around, cell, shape), near, far))
    return regions


def _pieces(filled: NDArray[np.uint8], least: float) -> list[Box]:
    """The boxes of what hangs together, across gaps of a cell, and is large enough."""
    closed = cv2.morphologyEx(filled, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    return [(int(x), int(y), int(w), int(h)) for x, y, w, h, _ in stats[1:]
            if w >= least and h >= least]


def _widened(cells: Box, around: int, cell: float, shape: tuple[int, int]) -> Box:
    """Whole cells, so that a sharper camera is searched in the same places; inside the image."""
    x, y, w, h = cells
    left, top = max(x - around, 0), max(y - around, 0)
    right = min(round((x + w + around) * cell), shape[1])
    bottom = min(round((y + h + around) * cell), shape[0])
    return round(left * cell), round(top * cell), right - round(left * cell), bottom - round(
        top * cell)
