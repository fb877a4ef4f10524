"""Stage 6: the seeds propagated over their support, holes filled, coloured by their neighbours.

Inside a hole there are no neighbours to be coloured by, often because it is dark there: brows,
hair, pupils. Their place in the colour image says more than the hole's border.
"""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes
from denseface.recon.face import DenseCloud, Seeds
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.noise import Risk
from denseface.recon.numerics.push_pull import interpolate_colors
from denseface.recon.numerics.scatter import BILINEAR_VARIANCE, pixel_coordinates
from denseface.recon.propagation._bridges import without_bridges
from denseface.recon.propagation._grid_kernels import Resampling, gather_points, indices_of_zeros
from denseface.recon.propagation.uncertainty import standard_error, variance_components

_COLOR_RADIUS = 0.58
"""Standard deviation of the Gaussian that averages the seeds' colours, mean spacings."""
_COLOR_STEP = 0.6
"""Distance of the points that colours are averaged at, mean spacings."""
_MIN_RADIUS_PX = 0.4
"""Least standard deviation of that Gaussian, pixels."""
_HOLE = 1.5
"""Farther than this from every seed, over (X, Y), a point is in a hole, mean spacings."""


def densify(
    seeds: Seeds, surface: SurfaceGrid, spacing: float, ratio: float, plan: Risk,
    sampler: ColorSampler | None = None,
) -> DenseCloud:
    """Sample the surface on a regular grid, `ratio` points for each seed.

    Parameters
    ----------
    seeds : the initial cloud
    surface : the fit over (X, Y), with its detail
    spacing : mean spacing of the seeds, mm
    ratio : dense points for each seed
    plan : the expected error of the fit
    sampler : tells the colours of points in holes; None, and their border's colours fill them
    """
    step = float(np.sqrt(surface.support.area / (ratio * len(seeds.points))))
    support = surface.support
    xs, ys = support.axes(step)
    inside = without_bridges(surface, (xs, ys), spacing)
    origin = float(xs[0]), float(ys[0])

    components = variance_components(
        seeds.points, support.inside, surface.values, origin, support.step, spacing)
    error = standard_error(components, plan, detailed=surface.detailed)
    sigma = np.asarray(cv2.copyMakeBorder(error, 0, 1, 0, 1, cv2.BORDER_REPLICATE), np.float32)
    every = max(1, round(_COLOR_STEP * spacing / step))
    colors = _colors(seeds, origin, every * step, spacing, _coarser(inside, every))
    columns, rows = support.coordinates(xs, ys)
    counted = [np.arange(side, dtype=np.float32) / np.float32(every) for side in inside.shape]
    nodes = [places / np.float32(components.every) for places in (rows, columns)]
    points, normals, colors, sigma, cells = gather_points(
        inside, xs, ys, Resampling(surface.values, rows, columns),
        Resampling(np.array(cv2.split(colors), np.float32), *counted),
        Resampling(sigma[None], *nodes))
    if sampler is not None:
        near = support.near_seeds(_HOLE * spacing)
        hole = indices_of_zeros(near, rows, columns, cells)
        if len(hole):
            own, seen = sampler(points[hole])
            colors[hole[seen]] = own[seen]
    return DenseCloud(points=points, colors=colors, normals=normals, sigma=sigma, cells=cells,
                      grid_shape=inside.shape, grid_step_mm=step)


def _colors(
    seeds: Seeds, origin: tuple[float, float], step: float, spacing: float, wanted: Bools
) -> Bytes:
    """The seeds' mean colour on a grid of its own, (rows, columns, 3)."""
    # Bilinear weights blur, once when colours are scattered and once when they are read.
    radius = np.sqrt(max((_COLOR_RADIUS * spacing / step) ** 2 - 2 * BILINEAR_VARIANCE,
                         _MIN_RADIUS_PX**2))
    return interpolate_colors(seeds.colors, pixel_coordinates(seeds.points, origin, step), wanted,
                             float(radius), spacing / step)


def _coarser(inside: Bools, every: int) -> Bools:
    """Which of every so many points each way are next to a supported one."""
    rows, columns = (-(-side // every) for side in inside.shape)
    whole = cv2.copyMakeBorder(
        inside.view(np.uint8) * 255, 0, (rows + 1) * every - inside.shape[0], 0,
        (columns + 1) * every - inside.shape[1], cv2.BORDER_CONSTANT, value=0)
    any_in = cv2.resize(whole, (columns + 1, rows + 1), interpolation=cv2.INTER_AREA)
    return cv2.dilate(any_in, np.ones((2, 2), np.uint8), anchor=(1, 1)) > 0
