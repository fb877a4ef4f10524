"""Where in the colour image a face can be, by depth: the nearest places first."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.detection._kernels import fill_layers, nearest_in_cells
from denseface.recon.detection._relief import bulging_cells
from denseface.recon.errors import NoDepthError
from denseface.recon.face import Box
from denseface.recon.intermediate import NO_DEPTH_MM, Registration

CELLS = 80
"""Cells across the colour image, in which depth is judged."""
NEAREST_MM, FARTHEST_MM = 300.0, 2000.0
"""Range that is searched. A farther face has under 2,000 depth pixels and noise of over 5 mm."""
_LAYERS = 7
_EDGES = np.geomspace(NEAREST_MM, FARTHEST_MM, _LAYERS + 1)
"""Where layers of depth begin and end, mm."""
_MIN_SIDE_MM = 90.0
"""A connected piece of a layer that is narrower or lower cannot hold a face."""
_HALF_FACE_MM = 90.0
"""From a face's centre, which is in the layer, to its sides, which may be in the next."""
_CENTER_MM = 80.0
"""Side of the square about a face's centre that must hold depth of the layer."""
_MIN_CENTER_SHARE = 0.2
"""Share of that square that must hold it."""
_MIN_BULGE_MM = 4.0
"""What bulges less is flat: the least of a face's own box, less what a cell's shift makes of it."""
_HALF_BOX_MM = 80.0
"""From a cell to the sides of the box in which a bulge is fitted."""
HALF_NARROWEST_MM, HALF_WIDEST_MM = 55.0, 105.0
"""Half of the narrowest and of the widest face."""


class Region(NamedTuple):
    """A part of the colour image in which something lies between two depths."""

    roi: Box
    near_mm: float
    far_mm: float
    centers: Bools
    """(rows, CELLS) of the whole image: where the centre of a face can be."""


def regions_by_depth(
    registered: Registration, shape: tuple[int, int], focal_px: float
) -> list[Region]:
    """Cut the scene into layers of depth, and each layer into connected pieces of the image.

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
    _check_measured(registered)
    cell = shape[1] / CELLS
    filled = np.zeros((_LAYERS, int(np.ceil(shape[0] / cell)), CELLS), np.uint8)
    fill_layers(registered.pixels, registered.color_depth, registered.visible, _EDGES, cell, filled)
    regions = []
    for near, far, layer in zip(_EDGES[:-1].tolist(), _EDGES[1:].tolist(), filled, strict=True):
        min_side = _MIN_SIDE_MM * focal_px / far / cell
        if min_side > CELLS or not layer.any():
            continue
        closed = cv2.morphologyEx(layer, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        side = 2 * round(_CENTER_MM * focal_px / np.sqrt(near * far) / cell / 2) + 1
        centers = cv2.blur(255 * closed, (side, side), borderType=cv2.BORDER_CONSTANT
                           ) > 255 * _MIN_CENTER_SHARE
        margin = round(_HALF_FACE_MM * focal_px / near / cell)
        _, _, pieces, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
        for x, y, w, h, _ in pieces[1:].tolist():
            if w >= min_side and h >= min_side:
                roi = padded((x, y, w, h), margin, cell, shape)
                regions.append(Region(roi, near, far, centers))
    return regions


def nearest_by_cell(registered: Registration, shape: tuple[int, int]) -> Floats:
    """Give the nearest depth in each cell of the colour image, (rows, CELLS) float32, mm.

    `NO_DEPTH_MM` where there is none. Parameters and errors are those of `regions_by_depth`.
    """
    _check_measured(registered)
    cell = shape[1] / CELLS
    nearest = np.full((int(np.ceil(shape[0] / cell)), CELLS), NO_DEPTH_MM)
    nearest_in_cells(registered.pixels, registered.color_depth, registered.visible, cell, nearest)
    return nearest


def _check_measured(registered: Registration) -> None:
    if not (registered.color_depth > 0).any():
        raise NoDepthError("no depth lies before the colour camera: is the calibration right?")


def without_flat(
    regions: list[Region], nearest: Floats, shape: tuple[int, int], focal_px: float
) -> list[Region]:
    """Keep only centres about which depth bulges, in regions as small as those allow.

    Parameters
    ----------
    regions : of `regions_by_depth`
    nearest : (rows, CELLS), of `nearest_by_cell`
    shape, focal_px : as of `regions_by_depth`
    """
    cell = shape[1] / CELLS
    remaining = []
    for region in regions:
        x, y, w, h = (round(side / cell) for side in region.roi)
        # Nearer to the image's border, the narrowest face is not whole.
        border = int(HALF_NARROWEST_MM * focal_px / region.far_mm / cell)
        inside = np.s_[max(y, border):min(y + h, len(nearest) - border),
                       max(x, border):min(x + w, CELLS - border)]
        allowed = np.zeros_like(region.centers)
        allowed[inside] = region.centers[inside]
        bulging = bulging_cells(nearest, allowed, _HALF_BOX_MM * focal_px / cell, _MIN_BULGE_MM)
        if bulging.any():
            margin = round(HALF_WIDEST_MM * focal_px / region.near_mm / cell)
            left, top, width, height = cv2.boundingRect(bulging.view(np.uint8))
            roi = padded((left, top, width, height), margin, cell, shape)
            remaining.append(region._replace(roi=roi, centers=bulging))
    return remaining


def padded(cells: Sequence[int], margin: int, cell: float, shape: tuple[int, int]) -> Box:
    """Widen a box of cells and give it in pixels, inside the image.

    Whole cells: the places that are searched do not depend on the camera's resolution.
    """
    x, y, w, h = cells
    left, top = round(max(x - margin, 0) * cell), round(max(y - margin, 0) * cell)
    right = min(round((x + w + margin) * cell), shape[1])
    bottom = min(round((y + h + margin) * cell), shape[0])
    return left, top, right - left, bottom - top


def scaled(box: Box, factor: float) -> Box:
    """Give a box in pixels of another size."""
    x, y, w, h = (round(side * factor) for side in box)
    return x, y, w, h


def resized(box: Box, factor: float) -> Box:
    """Make a box wider or narrower about its centre."""
    x, y, w, h = box
    width, height = round(w * factor), round(h * factor)
    return x + round((w - width) / 2), y + round((h - height) / 2), width, height
