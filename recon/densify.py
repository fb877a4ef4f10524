"""Stage 6: the seeds propagated over their support, holes filled, coloured by their neighbours.

Inside a hole there are no neighbours to be coloured by, often because it is dark there: brows,
hair, pupils. Their place in the colour image says more than the hole's border.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from recon._image_kernels import collect, unset
from recon._scatter_kernels import BILINEAR_VARIANCE, mark
from recon.colors import average_neighbors
from recon.detail import DetailedSurface
from recon.face import DenseCloud
from recon.masks import disc
from recon.rbf import Surface
from recon.registration import LookUp
from recon.segment import Seeds
from recon.support import support_on_grid
from recon.uncertainty import sources_of_error, standard_error

__all__ = ["densify"]

# In units of the mean spacing.
# A colour is the mean of the seeds around it, weighted by a Gaussian of this radius.
_COLOR_RADIUS = 0.58
_COLOR_STEP = 0.6
# In pixels; no blur is less.
_LEAST_RADIUS = 0.4
_COARSE = 0.5
# Farther than this from every seed, over (X, Y), a point is in a hole.
_HOLE = 1.5
# Steeper than this, and farther than that from every seed, the fit bridges a step: no sensor reads
# what it sees at so grazing an angle.
_STEEP = 4.0
_UNREAD = 0.7


def densify(
    seeds: Seeds,
    surface: Surface | DetailedSurface,
    spacing: float,
    ratio: float,
    share: float,
    look_up: LookUp | None = None,
) -> DenseCloud:
    """Sample the surface on a regular grid, `ratio` points for each seed.

    Parameters
    ----------
    seeds : the initial cloud
    surface : the fit over (X, Y)
    spacing : mean spacing of the seeds, mm
    ratio : dense points for each seed
    share : of the residuals' variance, how much the surface keeps as error: `noise_share`
    look_up : tells the colours of points in holes; None, and their border's colours fill them
    """
    # Filled holes add to the support: a coarse try tells how much, and the step follows.
    area = surface.area if isinstance(surface, DetailedSurface) else _supported_area(
        seeds.points, spacing)
    step = float(np.sqrt(area / (ratio * len(seeds.points))))
    xs, ys, support = support_on_grid(seeds.points, spacing, step)
    origin = float(xs[0]), float(ys[0])

    heights, slopes_x, slopes_y = surface.sampled(xs, ys)
    bridge = slopes_x * slopes_x + slopes_y * slopes_y > np.float32(_STEEP**2)
    if bridge.any():
        bridge &= _near_seeds(seeds, origin, step, support.shape, _UNREAD * spacing) == 0
        # Not for a speck: a surface riddled with pinholes is worse than a bridge.
        support &= cv2.morphologyEx(
            bridge.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) == 0
    sources = sources_of_error(
        seeds.points, support, heights, (slopes_x, slopes_y), origin, step, spacing)
    error = standard_error(sources, share, detailed=isinstance(surface, DetailedSurface))
    sigma = np.asarray(cv2.copyMakeBorder(error, 0, 1, 0, 1, cv2.BORDER_REPLICATE), np.float32)
    # Colours have no detail finer than the seeds: every so many points are enough.
    every = max(1, round(_COLOR_STEP * spacing / step))
    colors = _colors(seeds, origin, every * step, spacing, _coarser(support, every))
    points, normals, colors, sigma, cells = collect(
        support, xs, ys, heights, slopes_x, slopes_y, colors, every, sigma, sources.every)
    if look_up is not None:
        hole = unset(_near_seeds(seeds, origin, step, support.shape, _HOLE * spacing), cells)
        if len(hole):
            own, seen = look_up(points[hole])
            colors[hole[seen]] = own[seen]
    return DenseCloud(
        points=points,
        colors=colors,
        normals=normals,
        sigma=sigma,
        cells=cells,
        grid_shape=support.shape,
        grid_step_mm=step,
    )


def _supported_area(points: NDArray[np.float32], spacing: float) -> float:
    step = _COARSE * spacing
    _, _, support = support_on_grid(points, spacing, step)
    return float(np.count_nonzero(support) * step**2)


def _near_seeds(
    seeds: Seeds, origin: tuple[float, float], step: float, shape: tuple[int, ...], radius: float
) -> NDArray[np.uint8]:
    """Which grid points have a seed within a radius, mm, to half a step; 0 or 1."""
    seeded = mark(seeds.points, origin, step, shape[0], shape[1])
    return np.asarray(cv2.dilate(seeded, disc(radius / step)), np.uint8)


def _colors(
    seeds: Seeds, origin: tuple[float, float], step: float, spacing: float,
    wanted: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    """The seeds' mean colour on a grid of its own, (rows, columns, 3)."""
    # In double precision: no place may come out before the first.
    places = ((seeds.points[:, 1::-1] - origin[::-1]) / step).astype(np.float32)
    # Sharing a colour among four pixels, and reading between four, blurs by as much.
    radius = np.sqrt(max((_COLOR_RADIUS * spacing / step) ** 2 - 2 * BILINEAR_VARIANCE,
                         _LEAST_RADIUS**2))
    return average_neighbors(seeds.colors, places, wanted, float(radius), spacing / step)


def _coarser(support: NDArray[np.bool_], every: int) -> NDArray[np.bool_]:
    """Which of every so many points each way are next to a supported one."""
    rows, columns = (-(-side // every) for side in support.shape)
    whole = cv2.copyMakeBorder(
        support.view(np.uint8) * 255, 0, (rows + 1) * every - support.shape[0], 0,
        (columns + 1) * every - support.shape[1], cv2.BORDER_CONSTANT, value=0)
    any_in = cv2.resize(whole, (columns + 1, rows + 1), interpolation=cv2.INTER_AREA)
    return cv2.dilate(any_in, np.ones((2, 2), np.uint8), anchor=(1, 1)) > 0
