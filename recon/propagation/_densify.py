"""Stage 6: the seeds propagated over their support, holes filled, coloured by their neighbours.

Inside a hole there are no neighbours to be coloured by, often because it is dark there: brows,
hair, pupils. Their place in the colour image says more than the hole's border.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud, Seeds
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.numerics.push_pull import interpolate_colors
from denseface.recon.numerics.scatter import BILINEAR_VARIANCE, pixel_coordinates
from denseface.recon.propagation._grid_kernels import collect, unset
from denseface.recon.propagation.uncertainty import standard_error, variance_components
from denseface.recon.support import Support

__all__ = ["densify"]

# In units of the mean spacing.
# A colour is the mean of the seeds around it, weighted by a Gaussian of this radius.
_COLOR_RADIUS = 0.58
_COLOR_STEP = 0.6
# In pixels; no blur is less.
_LEAST_RADIUS = 0.4
# Farther than this from every seed, over (X, Y), a point is in a hole.
_HOLE = 1.5
# Steeper than this, and farther than that from every seed, the fit bridges a step: no sensor reads
# what it sees at so grazing an angle.
_STEEP = 4.0
_UNREAD = 0.7
# But for specks, of fewer points of the support's grid each way.
_SPECK = 2


def densify(
    seeds: Seeds,
    surface: SurfaceGrid,
    spacing: float,
    ratio: float,
    noise_fraction: float,
    sampler: ColorSampler | None = None,
) -> DenseCloud:
    """Sample the surface on a regular grid, `ratio` points for each seed.

    Parameters
    ----------
    seeds : the initial cloud
    surface : the fit over (X, Y), with its detail
    spacing : mean spacing of the seeds, mm
    ratio : dense points for each seed
    noise_fraction : k of `recon.propagation.uncertainty.noise_fraction`
    sampler : tells the colours of points in holes; None, and their border's colours fill them
    """
    supported, (heights, dz_dx, dz_dy) = surface.support, surface.values
    slopes = dz_dx, dz_dy
    step = float(np.sqrt(supported.area / (ratio * len(seeds.points))))
    supported = _without_bridges(supported, slopes, spacing)
    xs, ys, support = supported.on_grid(step)
    origin = float(xs[0]), float(ys[0])

    components = variance_components(
        seeds.points, supported.inside, heights, slopes, origin, supported.step, spacing)
    error = standard_error(components, noise_fraction, detailed=surface.detailed)
    sigma = np.asarray(cv2.copyMakeBorder(error, 0, 1, 0, 1, cv2.BORDER_REPLICATE), np.float32)
    # Colours have no detail finer than the seeds: every so many points are enough.
    every = max(1, round(_COLOR_STEP * spacing / step))
    colors = _colors(seeds, origin, every * step, spacing, _coarser(support, every))
    columns, rows = supported.coordinates(xs, ys)
    points, normals, colors, sigma, cells = collect(
        support, xs, ys, surface.values, rows, columns, colors, every, sigma, components.every)
    if sampler is not None:
        near = supported.near_seeds(_HOLE * spacing)
        hole = unset(near, rows, columns, cells)
        if len(hole):
            own, seen = sampler(points[hole])
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


def _without_bridges(
    supported: Support, slopes: tuple[NDArray[np.float32], NDArray[np.float32]], spacing: float
) -> Support:
    """Leave out where the fit bridges a step that nothing was read of."""
    along, down = slopes
    bridge = along * along + down * down > np.float32(_STEEP**2)
    if not bridge.any():
        return supported
    bridge &= supported.near_seeds(_UNREAD * spacing) == 0
    # A surface riddled with pinholes is worse than a bridge.
    kernel = np.ones((_SPECK, _SPECK), np.uint8)
    opened = cv2.dilate(cv2.erode(bridge.view(np.uint8), kernel), kernel, anchor=(0, 0))
    return supported.without(np.asarray(opened > 0))


def _colors(
    seeds: Seeds, origin: tuple[float, float], step: float, spacing: float,
    wanted: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    """The seeds' mean colour on a grid of its own, (rows, columns, 3)."""
    # Sharing a colour among four pixels, and reading between four, blurs by as much.
    radius = np.sqrt(max((_COLOR_RADIUS * spacing / step) ** 2 - 2 * BILINEAR_VARIANCE,
                         _LEAST_RADIUS**2))
    return interpolate_colors(
        seeds.colors, pixel_coordinates(seeds.points, origin, step), wanted,
        float(radius), spacing / step)


def _coarser(support: NDArray[np.bool_], every: int) -> NDArray[np.bool_]:
    """Which of every so many points each way are next to a supported one."""
    rows, columns = (-(-side // every) for side in support.shape)
    whole = cv2.copyMakeBorder(
        support.view(np.uint8) * 255, 0, (rows + 1) * every - support.shape[0], 0,
        (columns + 1) * every - support.shape[1], cv2.BORDER_CONSTANT, value=0)
    any_in = cv2.resize(whole, (columns + 1, rows + 1), interpolation=cv2.INTER_AREA)
    return cv2.dilate(any_in, np.ones((2, 2), np.uint8), anchor=(1, 1)) > 0
