"""A face as heights over a regular grid of the spacing in which it is printed.

All is decided on the grid, before there are triangles: which parts are kept, what is closed, and
where the outline runs.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats, Ints
from denseface.recon.face import DenseCloud
from denseface.service.errors import FormatError

__all__ = ["SPACING_MM", "Relief", "relief"]

SPACING_MM = 0.6
"""Of the grid, as printed: docs/decisions/0058-solids-for-printing.md says what it costs."""
_SOFTENING_MM, _LEAST_SOFTENING = 3.0, 1.5
"""Standard deviation of the Gaussian that evens the outline, mm of the face, and at least so many
spacings: on a face's steep sides a tooth of 1 mm is 5 mm long."""
_MIN_ISLAND_MM2 = 60.0
"""As printed: a smaller part that stands alone would be a pillar that breaks."""
_MAX_PLACES = 4_000_000
"""Of the grid, with what is around the face: a face has a tenth."""
_MAX_DEPTH_MM = 1000.0
_MAX_SIDE = 30_000
"""Places along a side of the grid, which OpenCV takes."""
_CLOSING = ((16.0, 6), (8.0, 6), (4.0, 8), (2.0, 10), (1.0, 20))
"""Standard deviation, places, and number of the Gaussians that draw a membrane over a hole."""


class Relief(NamedTuple):
    """A face as seen from the camera, the viewer's left at the left, its chin below.

    Attributes
    ----------
    heights : (r, c) float32, mm of the face toward the viewer; beyond the outline as at the outline
    colors : (r, c, 3) float32, RGB, 0 to 255
    inside : (r, c) float32, positive within the outline, negative beyond it, never zero
    step_mm : distance of the grid's places, mm of the face
    scale : mm as printed for each mm of the face
    """

    heights: Floats
    colors: Floats
    inside: Floats
    step_mm: float
    scale: float

    @property
    def spacing_mm(self) -> float:
        """Distance of the grid's places, as printed."""
        return self.step_mm * self.scale


def relief(
    cloud: DenseCloud, height_mm: float | None, margin_mm: float, *, islands: bool
) -> Relief:
    """Sample a face in the spacing of a print.

    Holes are closed by a membrane. What is narrower than 4 mm or so is left out (hair's tongues,
    bridges, parts that touch at a corner), and so are small parts that stand alone; of several
    others, all but the largest unless `islands`.

    Parameters
    ----------
    height_mm : of the face, as printed; None for life size
    margin_mm : that is to be around the face, as printed

    Raises
    ------
    FormatError
        Nothing is wide enough to be printed.
    """
    support, cells = _support(cloud)
    if support is None:
        raise _too_small()
    rows = np.flatnonzero(support.any(axis=1))
    scale = 1.0 if height_mm is None else height_mm / (
        (rows[-1] - rows[0] + 1) * cloud.grid_step_mm)
    # What was not measured is not made up: no finer than the face's own grid.
    step = max(SPACING_MM / scale, cloud.grid_step_mm)
    around = math.ceil(margin_mm / (step * scale)) + 4
    padded = math.ceil(around * step / cloud.grid_step_mm) + 1
    shape = tuple(math.ceil((side - 1) * cloud.grid_step_mm / step) + 1 + 2 * around
                  for side in support.shape)
    whole_shape = tuple(side + 2 * padded for side in support.shape)
    if max(shape + whole_shape) > _MAX_SIDE or max(
            math.prod(shape), math.prod(whole_shape) // 4) > _MAX_PLACES:
        raise FormatError(f"a face of {support.shape[0]} x {support.shape[1]} places of its grid "
                          "is too large to be printed")
    known = np.pad(support, padded)
    heights, colors = np.zeros(known.shape, np.float32), np.zeros((*known.shape, 3), np.float32)
    places = cells[:, 0] + padded, cells[:, 1] + padded
    heights[places] = cloud.points[:, 2].max() - cloud.points[:, 2]
    colors[places] = cloud.colors
    if not heights.max() <= _MAX_DEPTH_MM:
        raise FormatError(f"a face that is {heights.max():.0f} mm deep cannot be printed")
    whole = _closed(known)
    heights, colors = _filled(heights, known, whole), _filled(colors, known, whole)
    ratio = step / cloud.grid_step_mm
    start = padded - around * ratio

    def sampled(image: Floats, softening: float) -> Floats:
        return _sampled(image, shape, ratio, start, softening)

    blur = math.sqrt(max(0.0, ratio * ratio - 1)) / 2
    softening = max(_SOFTENING_MM / cloud.grid_step_mm, _LEAST_SOFTENING * ratio)
    inside = _outlined(sampled(whole.astype(np.float32), softening) - np.float32(0.5),
                       _MIN_ISLAND_MM2 / (step * scale) ** 2, islands=islands)
    if height_mm is not None:
        scale = height_mm / (_extent(inside) * step)
    return Relief(sampled(heights, blur), sampled(colors, blur), inside, step, scale)


def _support(cloud: DenseCloud) -> tuple[Bools | None, Ints]:
    """Give where there are points, within the rectangle that holds them, and their cells in it."""
    if not len(cloud):
        return None, cloud.cells
    cells = cloud.cells - cloud.cells.min(axis=0)
    support = np.zeros(cells.max(axis=0) + 1, np.bool_)
    support[cells[:, 0], cells[:, 1]] = True
    return support, cells


def _closed(mask: Bools) -> Bools:
    """Fill all that the background around does not reach along rows and columns."""
    image = np.pad(mask.astype(np.uint8), 1)
    cv2.floodFill(image, None, (0, 0), 2, flags=4)
    return np.asarray(image[1:-1, 1:-1] != 2)


def _filled(image: Floats, known: Bools, whole: Bools) -> Floats:
    """Give what is not known: in holes a membrane, beyond the outline the nearest value."""
    _, labels = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    values = np.zeros((labels.max() + 1, *image.shape[2:]), np.float32)
    values[labels[known]] = image[known]
    filled: Floats = values[labels]
    holes = whole & ~known
    if holes.any():
        for sigma, times in _CLOSING:
            for _ in range(times):
                filled[holes] = cv2.GaussianBlur(filled, (0, 0), sigma)[holes]
    return filled


def _sampled(
    image: Floats, shape: tuple[int, ...], ratio: float, start: float, softening: float
) -> Floats:
    """Sample an image every `ratio` places from `start` on, after a Gaussian."""
    if softening > 0.1:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), softening), np.float32)
    where = np.array([[ratio, 0, start], [0, ratio, start]])
    return np.asarray(cv2.warpAffine(
        image, where, shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE), np.float32)


def _outlined(inside: Floats, min_area: float, *, islands: bool) -> Floats:
    """Keep the parts that can be printed, close their holes, and let no place be on the outline."""
    # No closer to zero than this: a cut is never at a corner, and no triangle is a sliver of none.
    inside = np.where(inside > 0, np.maximum(inside, 0.02), np.minimum(inside, -0.02))
    _, labels, found, _ = cv2.connectedComponentsWithStats(
        (inside > 0).astype(np.uint8), connectivity=4)
    areas = found[1:, cv2.CC_STAT_AREA]
    if not areas.size or areas.max() < 4:
        raise _too_small()
    kept = np.flatnonzero(areas >= (min_area if islands else areas.max())) + 1
    if not kept.size:
        kept = np.array([areas.argmax() + 1])
    if not islands:
        kept = kept[:1]
    part = np.isin(labels, kept)
    inside = np.where((inside > 0) & ~part, -inside, inside)
    return np.where((inside < 0) & _closed(part), -inside, inside).astype(np.float32)


def _extent(inside: Floats) -> float:
    """Give how high the outline is, in places: it runs between them."""
    rows = np.flatnonzero((inside > 0).any(axis=1))

    def reach(row: int, beyond: int) -> float:
        here, there = inside[row], inside[beyond]
        cuts = here > 0
        return float((here[cuts] / (here[cuts] - np.minimum(there[cuts], 0))).max())

    top, bottom = int(rows[0]), int(rows[-1])
    return bottom - top + reach(top, top - 1) + reach(bottom, bottom + 1)


def _too_small() -> FormatError:
    return FormatError("no part of the face is wide enough to be printed")
