"""The loops over the dense grid, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["add_between", "collect"]


@compiled
def add_between(
    image: NDArray[np.float32], coarse: NDArray[np.float32], rows: NDArray[np.float32],
    columns: NDArray[np.float32],
) -> None:
    """Add another image, bilinear, to one, (m, k).

    rows, columns : (m,), (k,), places in `coarse`, inside it
    """
    last = coarse.shape[1] - 1
    line = np.empty(last + 2, np.float32)
    for i in range(len(rows)):
        above = int(rows[i])
        below = min(above + 1, coarse.shape[0] - 1)
        part = rows[i] - np.float32(above)
        for j in range(last + 1):
            line[j] = coarse[above, j] + part * (coarse[below, j] - coarse[above, j])
        line[last + 1] = line[last]
        own = image[i]
        for j in range(len(columns)):
            left = int(columns[j])
            own[j] += line[left] + (columns[j] - np.float32(left)) * (line[left + 1] - line[left])


@compiled
def collect(
    support: NDArray[np.bool_],
    xs: NDArray[np.float64],
    ys: NDArray[np.float64],
    heights: NDArray[np.float32],
    slopes_x: NDArray[np.float32],
    slopes_y: NDArray[np.float32],
    colors: NDArray[np.uint8],
    every: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, cells.

    colors : at every so many points each way, bilinear between; one more than covers the grid
    """
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    line = np.empty(3 * colors.shape[1], np.float32)
    whole = np.empty(3 * support.shape[1], np.float32)
    i = 0
    for row in range(support.shape[0]):
        above = row // every
        part = np.float32(row - above * every) / np.float32(every)
        one, other = colors[above].ravel(), colors[above + 1].ravel()
        for j in range(len(line)):
            line[j] = np.float32(0.5) + one[j] + part * (np.float32(other[j]) - one[j])
        for offset in range(every):
            part = np.float32(offset) / np.float32(every)
            for left in range((support.shape[1] - 1 - offset) // every + 1):
                at = 3 * (left * every + offset)
                for c in range(3):
                    here = line[3 * left + c]
                    whole[at + c] = here + part * (line[3 * left + 3 + c] - here)
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
                    rgb[i, c] = np.uint8(np.int32(whole[3 * column + c]))
                i += 1
    return points, normals, rgb, cells
