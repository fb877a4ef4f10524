"""Stage 6: the seeds propagated over their support, holes filled, coloured by their neighbours."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from recon.colors import average_neighbors
from recon.face import DenseCloud
from recon.rbf import Surface
from recon.segment import Seeds

__all__ = ["densify", "support_on_grid"]

# In units of the mean spacing. The support reaches half a spacing past the outermost seeds, as far
# as their own pixels do; gaps narrower than twice the closing are none.
_CLOSING = 1.2
_RIM = 0.5
# A colour is the mean of the seeds around it, weighted by a Gaussian of this radius.
_COLOR_RADIUS = 0.5


def densify(seeds: Seeds, surface: Surface, spacing: float, ratio: float) -> DenseCloud:
    """Sample the surface on a regular grid, `ratio` points for each seed.

    Parameters
    ----------
    seeds : the initial cloud
    surface : the fit over (X, Y)
    spacing : mean spacing of the seeds, mm
    ratio : dense points for each seed
    """
    step = spacing / np.sqrt(ratio)
    # Filled holes add to the support: one try tells how much, and the step follows.
    _, _, support = support_on_grid(seeds.points, spacing, step)
    step *= float(np.sqrt(support.sum() / (ratio * len(seeds.points))))
    xs, ys, support = support_on_grid(seeds.points, spacing, step)

    cells = np.argwhere(support).astype(np.int32)
    z = surface.on_grid(xs, ys)[support]
    points = np.column_stack([xs[cells[:, 1]], ys[cells[:, 0]], z]).astype(np.float32)
    colors = average_neighbors(
        seeds.colors, np.rint((seeds.points[:, 1::-1] - (ys[0], xs[0])) / step).astype(np.intp),
        support.shape, _COLOR_RADIUS * spacing / step, spacing / step)
    slope_x, slope_y = (g[support] for g in surface.gradient_on_grid(xs, ys))
    normals = np.column_stack([slope_x, slope_y, -np.ones_like(slope_x)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return DenseCloud(
        points=points,
        colors=colors[support],
        normals=normals.astype(np.float32),
        cells=cells,
        grid_shape=support.shape,
        grid_step_mm=step,
    )


def support_on_grid(
    points: NDArray[np.float32], spacing: float, step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Give the grid points over the seeds, with enclosed holes but nothing past the rim.

    Parameters
    ----------
    points : (n, 3) float32, mm
    spacing : mean spacing of the seeds, mm
    step : distance of grid points, mm

    Returns
    -------
    xs, ys : (columns,), (rows,) float64, mm
    support : (rows, columns) bool
    """
    reach = (_CLOSING + 1) * spacing
    low, high = points[:, :2].min(axis=0) - reach, points[:, :2].max(axis=0) + reach
    columns, rows = (int(n) for n in np.ceil((high - low) / step) + 1)
    xs, ys = low[0] + step * np.arange(columns), low[1] + step * np.arange(rows)
    place = np.rint((points[:, :2] - low) / step).astype(np.intp)
    empty = np.ones((rows, columns), np.uint8)
    empty[place[:, 1], place[:, 0]] = 0
    closed = _distance(empty) * step <= _CLOSING * spacing
    solid = binary_fill_holes(closed)
    return xs, ys, _distance(solid.astype(np.uint8)) * step > (_CLOSING - _RIM) * spacing


def _distance(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Distance of each pixel to the nearest zero, pixels."""
    return np.asarray(cv2.distanceTransform(image, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
