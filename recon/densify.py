"""Stage 6: the seeds propagated over their support, holes filled, coloured by their neighbours."""

import numpy as np

from recon._image_kernels import collect
from recon.adapt import AdaptiveSurface
from recon.colors import average_neighbors
from recon.face import DenseCloud
from recon.rbf import Surface
from recon.segment import Seeds
from recon.support import support_on_grid
from recon.uncertainty import sources_of_error, standard_error

__all__ = ["densify"]

# In units of the mean spacing.
# A colour is the mean of the seeds around it, weighted by a Gaussian of this radius.
_COLOR_RADIUS = 0.5
_COARSE = 0.5


def densify(
    seeds: Seeds, surface: Surface | AdaptiveSurface, spacing: float, ratio: float, share: float,
) -> DenseCloud:
    """Sample the surface on a regular grid, `ratio` points for each seed.

    Parameters
    ----------
    seeds : the initial cloud
    surface : the fit over (X, Y)
    spacing : mean spacing of the seeds, mm
    ratio : dense points for each seed
    share : of the residuals' variance, how much the surface keeps as error: `noise_share`
    """
    # Filled holes add to the support: a coarse try tells how much, and the step follows.
    _, _, support = support_on_grid(seeds.points, spacing, _COARSE * spacing)
    area = np.count_nonzero(support) * (_COARSE * spacing) ** 2
    step = float(np.sqrt(area / (ratio * len(seeds.points))))
    xs, ys, support = support_on_grid(seeds.points, spacing, step)

    heights, slopes_x, slopes_y = surface.sampled(xs, ys)
    places = np.rint((seeds.points[:, 1::-1] - (ys[0], xs[0])) / step).astype(np.intp)
    colors = average_neighbors(
        seeds.colors, places, support, _COLOR_RADIUS * spacing / step, spacing / step)
    points, normals, colors, cells = collect(
        support, xs, ys, heights, slopes_x, slopes_y, colors)
    sources = sources_of_error(
        seeds.points, support, heights, (slopes_x, slopes_y), (float(xs[0]), float(ys[0])), step,
        spacing)
    return DenseCloud(
        points=points,
        colors=colors,
        normals=normals,
        sigma=standard_error(sources, cells, share),
        cells=cells,
        grid_shape=support.shape,
        grid_step_mm=step,
    )
