"""Where in the colour image a face can be, by depth: the nearest places first."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detection._kernels import fill_layers, nearest_in_cells
from denseface.recon.detection._relief_kernels import curved_cells
from denseface.recon.errors import NoDepthError
from denseface.recon.face import Box
from denseface.recon.intermediate import Registration

__all__ = ["CELLS", "Region", "regions_by_depth", "without_flat"]

# A face farther away has under 2,000 depth pixels and noise of over 5 mm: no face worth having.
_NEAREST_MM, _FARTHEST_MM = 300.0, 2000.0
_LAYERS = 7
_EDGES = np.geomspace(_NEAREST_MM, _FARTHEST_MM, _LAYERS + 1)
CELLS = 80
"""Cells of the colour image, so many across, in which depth is looked at."""

# A piece of a layer that is smaller, both ways, can not hold a face.
_LEAST_MM = 90.0
# A face's middle is in the layer, its sides may be in the next.
_HALF_FACE_MM = 90.0
# Of a square about its middle, so wide, at least such a share holds depth of the layer.
_MIDDLE_MM = 80.0
_LEAST_SHARE = 0.2
# What bulges less than this about a middle, within half a face's width, is no face: the least that
# a face's own box must bulge, less what a cell aside makes of it.
_LEAST_BULGE_MM = 4.0
_HALF_BOX_MM = 80.0
_HALF_NARROWEST_MM, _HALF_WIDEST_MM = 55.0, 105.0
_NOTHING = np.float32(1e30)


class Region(NamedTuple):
    """A part of the colour image in which something lies between two depths."""

    part: Box
    near_mm: float
    far_mm: float
    middles: NDArray[np.bool_]
    """(rows, CELLS) of the whole image: where the middle of a face can be."""


def regions_by_depth(
    registered: Registration, shape: tuple[int, int], focal_px: float,
    nearer_than_mm: float = _FARTHEST_MM,
) -> list[Region]:
    """Cut the scene into layers of depth, and each layer into what hangs together in the image.

    Parameters
    ----------
    registered : the depth tied to the colour image; every k-th pixel is enough
    shape : rows and columns of the colour image
    focal_px : its focal length, pixels
    nearer_than_mm : what is farther is left out

    Raises
    ------
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    if not (registered.color_depth > 0).any():
        raise NoDepthError("no depth lies before the colour camera: is the calibration right?")
    edges = np.append(_EDGES[nearer_than_mm > _EDGES], min(nearer_than_mm, _FARTHEST_MM))
    cell = shape[1] / CELLS
    filled = np.zeros((len(edges) - 1, int(np.ceil(shape[0] / cell)), CELLS), np.uint8)
    fill_layers(registered.pixels, registered.color_depth, registered.visible, edges, cell, filled)
    regions = []
    for near, far, layer in zip(edges[:-1].tolist(), edges[1:].tolist(), filled, strict=True):
        least = _LEAST_MM * focal_px / far / cell
        if least > CELLS or not layer.any():
            continue
        closed = cv2.morphologyEx(layer, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        side = 2 * round(_MIDDLE_MM * focal_px / np.sqrt(near * far) / cell / 2) + 1
        middles = cv2.blur(255 * closed, (side, side), borderType=cv2.BORDER_CONSTANT
                           ) > 255 * _LEAST_SHARE
        around = round(_HALF_FACE_MM * focal_px / near / cell)
        _, _, pieces, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
        for x, y, w, h, _ in pieces[1:].tolist():
            if w >= least and h >= least:
                part = _widened((x, y, w, h), around, cell, shape)
                regions.append(Region(part, near, far, middles))
    return regions


def without_flat(
    regions: list[Region], registered: Registration, shape: tuple[int, int], focal_px: float
) -> list[Region]:
    """Give the regions without the middles about which no depth bulges, as small as is left.

    Parameters are those of `regions_by_depth`.
    """
    if not regions:
        return []
    cell = shape[1] / CELLS
    nearest = np.full(regions[0].middles.shape, _NOTHING)
    nearest_in_cells(registered.pixels, registered.color_depth, registered.visible, cell, nearest)
    remaining = []
    for region in regions:
        x, y, w, h = (round(side / cell) for side in region.part)
        # Nearer to the image's border, the narrowest face is not whole.
        off = int(_HALF_NARROWEST_MM * focal_px / region.far_mm / cell)
        there = np.s_[max(y, off):min(y + h, len(nearest) - off),
                      max(x, off):min(x + w, CELLS - off)]
        wanted = np.zeros_like(region.middles)
        wanted[there] = region.middles[there]
        curved = curved_cells(nearest, wanted, _HALF_BOX_MM * focal_px / cell, _LEAST_BULGE_MM)
        if curved.any():
            around = round(_HALF_WIDEST_MM * focal_px / region.near_mm / cell)
            left, top, width, height = cv2.boundingRect(curved.view(np.uint8))
            part = _widened((left, top, width, height), around, cell, shape)
            remaining.append(region._replace(part=part, middles=curved))
    return remaining


def _widened(cells: Box, around: int, cell: float, shape: tuple[int, int]) -> Box:
    """Whole cells, so that a sharper camera is searched in the same places; inside the image."""
    x, y, w, h = cells
    left, top = max(x - around, 0), max(y - around, 0)
    right = min(round((x + w + around) * cell), shape[1])
    bottom = min(round((y + h + around) * cell), shape[0])
    return round(left * cell), round(top * cell), right - round(left * cell), bottom - round(
        top * cell)
