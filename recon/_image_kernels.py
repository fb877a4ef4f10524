"""The loops over the dense grid, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["blur", "collect", "divide"]


@compiled
def blur(image: NDArray[np.float32], taps: NDArray[np.float32]) -> NDArray[np.float32]:
    """Filter the rows and the columns of (rows, columns, 4) alike; zero outside.

    taps : (2 reach + 1,), symmetric
    """
    rows, columns, channels = image.shape
    reach = len(taps) // 2
    length = columns * channels
    lines = image.reshape(rows, length)
    out = np.zeros((rows, length), np.float32)
    # One row at a time stays in the processor's nearest cache.
    padded = np.zeros(length + 2 * reach * channels, np.float32)
    for row in range(rows):
        down = padded[reach * channels:reach * channels + length]
        down[:] = 0
        for k in range(max(0, reach - row), min(len(taps), rows + reach - row)):
            factor, line = taps[k], lines[row + k - reach]
            for i in range(length):
                down[i] += factor * line[i]
        across = out[row]
        for k in range(len(taps)):
            factor, line = taps[k], padded[k * channels:k * channels + length]
            for i in range(length):
                across[i] += factor * line[i]
    return out.reshape(rows, columns, channels)


@compiled
def divide(
    sums: NDArray[np.float32], wanted: NDArray[np.bool_], least: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Give sums[..., :3] / sums[..., 3] where that is wanted and more than `least`.

    Gives (rows, columns, 3), zero elsewhere, and (rows, columns): wanted, but too little there.
    """
    rows, columns = wanted.shape
    mean = np.zeros((rows, columns, 3), np.float32)
    missing = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if wanted[row, column]:
                count = sums[row, column, 3]
                if count > least:
                    for c in range(3):
                        mean[row, column, c] = sums[row, column, c] / count
                else:
                    missing[row, column] = True
    return mean, missing


@compiled
def collect(
    support: NDArray[np.bool_],
    xs: NDArray[np.float64],
    ys: NDArray[np.float64],
    heights: NDArray[np.float32],
    slopes_x: NDArray[np.float32],
    slopes_y: NDArray[np.float32],
    colors: NDArray[np.uint8],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, cells."""
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    i = 0
    for row in range(support.shape[0]):
        for column in range(support.shape[1]):
            if support[row, column]:
                cells[i, 0], cells[i, 1] = row, column
                points[i, 0], points[i, 1] = xs[column], ys[row]
                points[i, 2] = heights[row, column]
                dx, dy = slopes_x[row, column], slopes_y[row, column]
                length = np.sqrt(dx * dx + dy * dy + np.float32(1))
                normals[i, 0], normals[i, 1] = dx / length, dy / length
                normals[i, 2] = np.float32(-1) / length
                for c in range(3):
                    rgb[i, c] = colors[row, column, c]
                i += 1
    return points, normals, rgb, cells
