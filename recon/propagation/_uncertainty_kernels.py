"""The loop of the standard error, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["node_statistics"]


@compiled
def node_statistics(
    points: NDArray[np.float32], support: NDArray[np.bool_], surface: NDArray[np.float32],
    origin: tuple[float, float], step: float, every: int,
) -> NDArray[np.float32]:
    """Gather what the standard error is made of on every so many grid points, the nodes.

    points : (n, 3), mm; those off the support do not count
    support : (rows, columns)
    surface : (3, rows, columns), height, mm, dz/dx and dz/dy
    origin : (x, y) of the grid's first point, mm; step : distance of its points, mm

    Gives (rows / every, columns / every, 4), rounded up: 1 on the support, slope^2 there, seeds
    nearest to the node, sum of their squared residuals, mm^2.
    """
    rows, columns = support.shape
    heights, slopes_x, slopes_y = surface[0], surface[1], surface[2]
    out = np.zeros(((rows + every - 1) // every, (columns + every - 1) // every, 4), np.float32)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            row, column = i * every, j * every
            if support[row, column]:
                dx, dy = slopes_x[row, column], slopes_y[row, column]
                out[i, j, 0] = 1
                out[i, j, 1] = dx * dx + dy * dy
    for k in range(len(points)):
        x, y = (points[k, 0] - origin[0]) / step, (points[k, 1] - origin[1]) / step
        row, column = int(np.floor(y + 0.5)), int(np.floor(x + 0.5))
        if 0 <= row < rows and 0 <= column < columns and support[row, column]:
            rest = points[k, 2] - heights[row, column] - step * (
                slopes_x[row, column] * (x - column) + slopes_y[row, column] * (y - row))
            i = min((row + every // 2) // every, out.shape[0] - 1)
            j = min((column + every // 2) // every, out.shape[1] - 1)
            out[i, j, 2] += 1
            out[i, j, 3] += rest * rest
    return out
