"""The loops over the dense grid, compiled.

What is known at fewer points is read between them along the rows first, once for each of its own
rows, then from row to row.
"""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["add_between", "collect", "unset"]


@compiled
def add_between(
    image: NDArray[np.float32], coarse: NDArray[np.float32], rows: NDArray[np.float32],
    columns: NDArray[np.float32],
) -> None:
    """Add another image, bilinear, to one, (m, k).

    rows, columns : (m,), (k,), places in `coarse`, inside it, rising
    """
    count = len(columns)
    left, part = np.empty(count, np.uint32), np.empty(count, np.float32)
    for j in range(count):
        left[j] = min(int(columns[j]), coarse.shape[1] - 2)
        part[j] = columns[j] - np.float32(left[j])
    upper, lower = np.empty(count, np.float32), np.empty(count, np.float32)
    known = -2
    for i in range(len(rows)):
        above = min(int(rows[i]), coarse.shape[0] - 2)
        if above == known + 1:
            upper, lower = lower, upper
        elif above != known:
            _along(coarse[above], left, part, 1, upper)
        if above != known:
            _along(coarse[above + 1], left, part, 1, lower)
            known = above
        down = rows[i] - np.float32(above)
        own = image[i]
        for j in range(count):
            own[j] += upper[j] + down * (lower[j] - upper[j])


@compiled
def _along(
    line: NDArray[np.float32], left: NDArray[np.uint32], part: NDArray[np.float32],
    channels: int, out: NDArray[np.float32],
) -> None:
    """Read a row between its points; `left` and `part` of each value."""
    right = np.uint32(channels)
    for j in range(len(out)):
        here = line[left[j]]
        out[j] = here + part[j] * (line[left[j] + right] - here)


@compiled
def _steps(
    every: int, channels: int, count: int
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Give `_along`'s places for so many points, of which every so many are known."""
    left, part = np.empty(channels * count, np.uint32), np.empty(channels * count, np.float32)
    for j in range(count):
        for c in range(channels):
            left[channels * j + c] = channels * (j // every) + c
            part[channels * j + c] = np.float32(j % every) / np.float32(every)
    return left, part


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
    sigma: NDArray[np.float32],
    each: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32],
           NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, sigma, cells.

    colors, sigma : at every so many points each way, at each so many, bilinear between; both have
        one more row and column than cover the grid
    """
    rows, columns = support.shape
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    error = np.empty(n, np.float32)
    x, known = xs.astype(np.float32), colors.astype(np.float32)
    color_left, color_part = _steps(every, 3, columns)
    sigma_left, sigma_part = _steps(each, 1, columns)
    color_above, color_below = np.empty(3 * columns, np.float32), np.empty(3 * columns, np.float32)
    sigma_above, sigma_below = np.empty(columns, np.float32), np.empty(columns, np.float32)
    whole, lengths = np.empty(3 * columns, np.uint8), np.empty(columns, np.float32)
    i = 0
    for row in range(rows):
        above = row // every
        if row % every == 0:
            color_above, color_below = color_below, color_above
            if row == 0:
                _along(known[0].ravel(), color_left, color_part, 3, color_above)
            _along(known[above + 1].ravel(), color_left, color_part, 3, color_below)
        if row % each == 0:
            sigma_above, sigma_below = sigma_below, sigma_above
            if row == 0:
                _along(sigma[0], sigma_left, sigma_part, 1, sigma_above)
            _along(sigma[row // each + 1], sigma_left, sigma_part, 1, sigma_below)
        on = support[row]
        first, end = 0, columns
        while first < columns and not on[first]:
            first += 1
        while end > first and not on[end - 1]:
            end -= 1
        down = np.float32(row % every) / np.float32(every)
        upper, lower = color_above[3 * first:3 * end], color_below[3 * first:3 * end]
        between = whole[3 * first:3 * end]
        for j in range(len(between)):
            between[j] = np.uint8(np.int32(
                upper[j] + down * (lower[j] - upper[j]) + np.float32(0.5)))
        down = np.float32(row % each) / np.float32(each)
        y = np.float32(ys[row])
        # Slices, since an index that might be negative keeps a loop from being vectorised.
        while first < end:
            stop = first
            while stop < end and on[stop]:
                stop += 1
            count = stop - first
            flat = points[i:i + count].ravel()
            across, z = x[first:stop], heights[row, first:stop]
            for j in range(count):
                flat[3 * j], flat[3 * j + 1], flat[3 * j + 2] = across[j], y, z[j]
            flat = normals[i:i + count].ravel()
            dx, dy = slopes_x[row, first:stop], slopes_y[row, first:stop]
            for j in range(count):
                lengths[j] = np.float32(1) / np.sqrt(dx[j] * dx[j] + dy[j] * dy[j] + np.float32(1))
            for j in range(count):
                flat[3 * j], flat[3 * j + 1] = dx[j] * lengths[j], dy[j] * lengths[j]
                flat[3 * j + 2] = -lengths[j]
            taken, seen = rgb[i:i + count].ravel(), whole[3 * first:3 * stop]
            for j in range(3 * count):
                taken[j] = seen[j]
            off, upper, lower = (
                error[i:i + count], sigma_above[first:stop], sigma_below[first:stop])
            for j in range(count):
                off[j] = upper[j] + down * (lower[j] - upper[j])
            place = cells[i:i + count].ravel()
            for j in range(count):
                place[2 * j], place[2 * j + 1] = row, first + j
            i += count
            first = stop
            while first < end and not on[first]:
                first += 1
    return points, normals, rgb, error, cells


@compiled
def unset(image: NDArray[np.uint8], cells: NDArray[np.int32]) -> NDArray[np.int64]:
    """Give the indices of the cells where an image is zero."""
    out = np.empty(len(cells), np.int64)
    count = 0
    for i in range(len(cells)):
        out[count] = i
        if image[np.uint32(cells[i, 0]), np.uint32(cells[i, 1])] == 0:
            count += 1
    return out[:count].copy()
