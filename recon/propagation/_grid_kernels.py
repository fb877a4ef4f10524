"""The loops over the dense grid, compiled.

What is known at fewer points is read between them along the rows first, once for each of its own
rows, then from row to row.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.bilinear import column_positions, read_row
from denseface.recon.numerics.jit import compiled

__all__ = ["collect", "unset"]

# Indices without a sign spare the compiler's question whether one counts from the end.
_0, _1, _2, _3 = (np.uint64(k) for k in range(4))


@compiled
def _steps(
    every: int, channels: int, count: int
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Give `read_row`'s places for so many points, of which every so many are known."""
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
    sheet: NDArray[np.float32],
    sheet_rows: NDArray[np.float32],
    sheet_columns: NDArray[np.float32],
    colors: NDArray[np.uint8],
    every: int,
    sigma: NDArray[np.float32],
    each: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32],
           NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, sigma, cells.

    sheet : (3, rows, columns), heights, and slopes along x and y, on a grid of its own, bilinear
        between
    sheet_rows, sheet_columns : (m,), (k,), where the points are on that grid, inside it, rising
    colors : at every so many points each way, bilinear between
    sigma : at each so many points of the sheet, bilinear between
        Both have one more row and column than cover their grid.
    """
    rows, columns = support.shape
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    error = np.empty(n, np.float32)
    # Flat, with indices that have no sign: a slice for each row takes longer than its numbers.
    flat_points, flat_normals = points.ravel(), normals.ravel()
    flat_rgb, flat_cells = rgb.ravel(), cells.ravel()
    flat_sheet, flat_sigma, flat_support = sheet.ravel(), sigma.ravel(), support.ravel()
    x, known = xs.astype(np.float32), colors.astype(np.float32).ravel()
    color_left, color_part = _steps(every, 3, columns)
    left, part = column_positions(sheet_columns, sheet.shape[2])
    sigma_left, sigma_part = column_positions(sheet_columns / np.float32(each), sigma.shape[1])
    # What is known of the row above and of the row below.
    c0, c1 = np.empty(3 * columns, np.float32), np.empty(3 * columns, np.float32)
    z0, z1 = np.empty(columns, np.float32), np.empty(columns, np.float32)
    x0, x1 = np.empty(columns, np.float32), np.empty(columns, np.float32)
    y0, y1 = np.empty(columns, np.float32), np.empty(columns, np.float32)
    s0, s1 = np.empty(columns, np.float32), np.empty(columns, np.float32)
    z, off = np.empty(columns, np.float32), np.empty(columns, np.float32)
    dx, dy = np.empty(columns, np.float32), np.empty(columns, np.float32)
    lengths, whole = np.empty(columns, np.float32), np.empty(3 * columns, np.uint8)
    wide, plane = np.uint64(sheet.shape[2]), np.uint64(sheet.shape[1] * sheet.shape[2])
    color_wide, sigma_wide = np.uint64(3 * colors.shape[1]), np.uint64(sigma.shape[1])
    upper_row, upper_node = -2, -2
    firsts, ends = _extents(support)
    i = _0
    for row in range(rows):
        if row % every == 0:
            c0, c1 = c1, c0
            first, end = _widest(firsts, ends, row, min(row + 2 * every, rows))
            if row == 0:
                read_row(known, _0, color_left, color_part, _3, _3 * first, _3 * end, c0)
            read_row(known, np.uint64(row // every + 1) * color_wide, color_left, color_part, _3,
                     _3 * first, _3 * end, c1)
        upper = min(int(sheet_rows[row]), sheet.shape[1] - 2)
        if upper != upper_row:
            at, behind = np.uint64(upper) * wide, row + 1
            while behind < rows and sheet_rows[behind] < np.float32(upper + 2):
                behind += 1
            first, end = _widest(firsts, ends, row, behind)
            if upper == upper_row + 1:
                z0, z1, x0, x1, y0, y1 = z1, z0, x1, x0, y1, y0
            else:
                read_row(flat_sheet, at, left, part, _1, first, end, z0)
                read_row(flat_sheet, at + plane, left, part, _1, first, end, x0)
                read_row(flat_sheet, at + plane + plane, left, part, _1, first, end, y0)
            at += wide
            read_row(flat_sheet, at, left, part, _1, first, end, z1)
            read_row(flat_sheet, at + plane, left, part, _1, first, end, x1)
            read_row(flat_sheet, at + plane + plane, left, part, _1, first, end, y1)
            upper_row = upper
        node = int(sheet_rows[row] / np.float32(each))
        if node != upper_node:
            at = np.uint64(node) * sigma_wide
            read_row(flat_sigma, at, sigma_left, sigma_part, _1, _0, np.uint64(columns), s0)
            read_row(flat_sigma, at + sigma_wide, sigma_left, sigma_part, _1, _0,
                     np.uint64(columns), s1)
            upper_node = node
        line = np.uint64(row) * np.uint64(columns)
        first, end = firsts[row], ends[row]
        down = np.float32(row % every) / np.float32(every)
        for j in range(_3 * first, _3 * end):
            whole[j] = np.uint8(np.int32(c0[j] + down * (c1[j] - c0[j]) + np.float32(0.5)))
        down = sheet_rows[row] - np.float32(upper)
        _mix(z0, z1, down, first, end, z)
        _mix(x0, x1, down, first, end, dx)
        _mix(y0, y1, down, first, end, dy)
        down = sheet_rows[row] / np.float32(each) - np.float32(node)
        _mix(s0, s1, down, first, end, off)
        for j in range(first, end):
            lengths[j] = np.float32(1) / np.sqrt(dx[j] * dx[j] + dy[j] * dy[j] + np.float32(1))
        y = np.float32(ys[row])
        while first < end:
            stop = first
            while stop < end and flat_support[line + stop]:
                stop += _1
            count = stop - first
            at = _3 * i
            for j in range(count):
                flat_points[at + _3 * j] = x[first + j]
                flat_points[at + _3 * j + _1] = y
                flat_points[at + _3 * j + _2] = z[first + j]
            for j in range(count):
                flat_normals[at + _3 * j] = dx[first + j] * lengths[first + j]
                flat_normals[at + _3 * j + _1] = dy[first + j] * lengths[first + j]
                flat_normals[at + _3 * j + _2] = -lengths[first + j]
            seen = _3 * first
            for j in range(_3 * count):
                flat_rgb[at + j] = whole[seen + j]
            for j in range(count):
                error[i + j] = off[first + j]
            at = _2 * i
            for j in range(count):
                flat_cells[at + _2 * j] = row
                flat_cells[at + _2 * j + _1] = first + j
            i += count
            first = stop
            while first < end and not flat_support[line + first]:
                first += _1
    return points, normals, rgb, error, cells


@compiled
def _extents(support: NDArray[np.bool_]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Give each row's first supported column, and the first behind all of them; 0 where none."""
    rows, columns = support.shape
    flat = support.ravel()
    firsts, ends = np.zeros(rows, np.uint64), np.zeros(rows, np.uint64)
    for row in range(rows):
        line = np.uint64(row) * np.uint64(columns)
        first, end = _0, np.uint64(columns)
        while first < end and not flat[line + first]:
            first += _1
        while end > first and not flat[line + end - _1]:
            end -= _1
        if end > first:
            firsts[row], ends[row] = first, end
    return firsts, ends


@compiled
def _widest(
    firsts: NDArray[np.uint64], ends: NDArray[np.uint64], begin: int, behind: int
) -> tuple[np.uint64, np.uint64]:
    """Give the first column of some rows, and the first behind all of theirs."""
    first, end = firsts[begin], ends[begin]
    for row in range(begin + 1, behind):
        if ends[row] > 0:
            first = min(first, firsts[row]) if end > 0 else firsts[row]
            end = max(end, ends[row])
    return first, end


@compiled
def _mix(
    upper: NDArray[np.float32], lower: NDArray[np.float32], down: np.float32, first: np.uint64,
    end: np.uint64, out: NDArray[np.float32],
) -> None:
    """Read from row to row, from one column to before another."""
    for j in range(first, end):
        out[j] = upper[j] + down * (lower[j] - upper[j])


@compiled
def unset(
    image: NDArray[np.uint8], rows: NDArray[np.float32], columns: NDArray[np.float32],
    cells: NDArray[np.int32],
) -> NDArray[np.int64]:
    """Give the indices of the cells at whose places an image, to the nearest pixel, is zero.

    rows, columns : (m,), (k,), where in the image the cells' rows and columns are, inside it
    """
    row, column = (rows + np.float32(0.5)).astype(np.uint32), (
        columns + np.float32(0.5)).astype(np.uint32)
    out = np.empty(len(cells), np.int64)
    count = 0
    for i in range(len(cells)):
        out[count] = i
        if image[row[np.uint32(cells[i, 0])], column[np.uint32(cells[i, 1])]] == 0:
            count += 1
    return out[:count].copy()
