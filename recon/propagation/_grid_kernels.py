"""The loops over the dense grid, compiled.

What is known at fewer points is read between them along the rows first, once for each of its own
rows, then from row to row.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.bilinear import column_positions, read_row
from denseface.recon.numerics.jit import compiled, inlined

__all__ = ["Nodes", "Resampling", "gather_points", "indices_of_zeros"]

# Unsigned indices spare the compiled code a test whether one counts from the end.
_0, _1, _2, _3 = (np.uint64(k) for k in range(4))

Floats = NDArray[np.float32]
Extents = NDArray[np.uint64]


class Nodes(NamedTuple):
    """Values, (rows, columns, ...), at every so many points each way, bilinear between.

    One row and column more than cover their grid.
    """

    values: NDArray[Any]
    every: int


class Resampling(NamedTuple):
    """Heights and slopes on another grid, bilinear between its points.

    Attributes
    ----------
    values : (3, rows, columns) float32, mm; dz/dx, dz/dy
    rows, columns : (m,), (k,) float32, where the points are on that grid, inside it, rising
    """

    values: Floats
    rows: Floats
    columns: Floats


@compiled
def gather_points(
    support: NDArray[np.bool_], xs: NDArray[np.float64], ys: NDArray[np.float64],
    surface: Resampling, colors: Nodes, sigma: Nodes,
) -> tuple[Floats, Floats, NDArray[np.uint8], Floats, NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, sigma, cells.

    support : (m, k); xs, ys : (k,), (m,), mm
    colors : (rows, columns, 3) uint8, on this grid's points
    sigma : (rows, columns) float32, mm, on those of the surface's grid
    """
    rows, columns = support.shape
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    error = np.empty(n, np.float32)
    # Flat arrays, no slices or tuples in the loop: each counts references, for every row.
    flat_points, flat_normals, flat_rgb, flat_cells = (
        points.ravel(), normals.ravel(), rgb.ravel(), cells.ravel())
    flat_support, x = support.ravel(), xs.astype(np.float32)
    values, places, across = surface
    flat_values, wide = values.ravel(), np.uint64(values.shape[2])
    plane = np.uint64(values.shape[1]) * wide
    left, part = column_positions(across, values.shape[2])
    known, color_wide = colors.values.astype(np.float32).ravel(), 3 * colors.values.shape[1]
    every, each = colors.every, np.float32(sigma.every)
    color_left, color_part = _steps(every, 3, columns)
    flat_sigma, sigma_wide = sigma.values.ravel(), np.uint64(sigma.values.shape[1])
    sigma_left, sigma_part = column_positions(across / each, sigma.values.shape[1])
    # Known rows above and below, and what is between: heights and slopes, colours, sigma.
    s0, s1, s = _empty_row(3 * columns), _empty_row(3 * columns), _empty_row(3 * columns)
    c0, c1, c = _empty_row(3 * columns), _empty_row(3 * columns), np.empty(3 * columns, np.uint8)
    e0, e1, e = _empty_row(columns), _empty_row(columns), _empty_row(columns)
    facing = _empty_row(columns)
    upper_row, upper_node = -2, -2
    firsts, ends = _extents(support)
    i = _0
    for row in range(rows):
        if row % every == 0:
            c0, c1 = c1, c0
            first, end = _widest(firsts, ends, row, min(row + 2 * every, rows))
            if row == 0:
                read_row(known, _0, color_left, color_part, _3, _3 * first, _3 * end, c0)
            read_row(known, np.uint64((row // every + 1) * color_wide), color_left, color_part, _3,
                     _3 * first, _3 * end, c1)
        upper = min(int(places[row]), values.shape[1] - 2)
        if upper != upper_row:
            first, end = _widest(firsts, ends, row, _next_place(places, row, upper + 2))
            if upper == upper_row + 1:
                s0, s1 = s1, s0
            else:
                _read_planes(flat_values, np.uint64(upper) * wide, plane, left, part, first, end,
                             s0)
            _read_planes(flat_values, np.uint64(upper + 1) * wide, plane, left, part, first, end,
                         s1)
            upper_row = upper
        node = int(places[row] / each)
        if node != upper_node:
            at = np.uint64(node) * sigma_wide
            read_row(flat_sigma, at, sigma_left, sigma_part, _1, _0, np.uint64(columns), e0)
            read_row(flat_sigma, at + sigma_wide, sigma_left, sigma_part, _1, _0,
                     np.uint64(columns), e1)
            upper_node = node
        first, end = firsts[row], ends[row]
        _mix_colors(c0, c1, np.float32(row % every) / np.float32(every), first, end, c)
        _mix_planes(s0, s1, places[row] - np.float32(upper), first, end, s, facing)
        _mix(e0, e1, places[row] / each - np.float32(node), first, end, e)
        line = np.uint64(row) * np.uint64(columns)
        while first < end:
            stop = first
            while stop < end and flat_support[line + stop]:
                stop += _1
            _write_points(x, np.float32(ys[row]), s, first, stop, flat_points, i)
            _write_normals(s, facing, first, stop, flat_normals, i)
            for j in range(_3 * (stop - first)):
                flat_rgb[_3 * i + j] = c[_3 * first + j]
            for j in range(stop - first):
                error[i + j] = e[first + j]
            for j in range(stop - first):
                flat_cells[_2 * (i + j)] = row
                flat_cells[_2 * (i + j) + _1] = first + j
            i += stop - first
            first = stop
            while first < end and not flat_support[line + first]:
                first += _1
    return points, normals, rgb, error, cells


@inlined
def _empty_row(count: int) -> Floats:
    """Room for so many values."""
    return np.empty(count, np.float32)


@compiled
def _steps(
    every: int, channels: int, count: int
) -> tuple[NDArray[np.uint32], Floats]:
    """Give `read_row`'s positions for so many points, of which every so many are known."""
    left, part = np.empty(channels * count, np.uint32), np.empty(channels * count, np.float32)
    for j in range(count):
        for c in range(channels):
            left[channels * j + c] = channels * (j // every) + c
            part[channels * j + c] = np.float32(j % every) / np.float32(every)
    return left, part


@compiled
def _next_place(places: Floats, row: int, least: int) -> int:
    """Give the first row behind `row` whose place is not less, or how many rows there are."""
    behind = row + 1
    while behind < len(places) and places[behind] < np.float32(least):
        behind += 1
    return behind


@compiled
def _read_planes(
    flat: Floats, at: np.uint64, plane: np.uint64, left: NDArray[np.uint32], part: Floats,
    first: np.uint64, end: np.uint64, out: Floats,
) -> None:
    """Read a row of height and slopes, one behind the other, as `read_row` does."""
    columns = np.uint64(len(left))
    for k in range(_3):
        for j in range(first, end):
            here = flat[at + k * plane + left[j]]
            out[k * columns + j] = here + part[j] * (flat[at + k * plane + left[j] + _1] - here)


@compiled
def _mix_planes(
    upper: Floats, lower: Floats, down: np.float32, first: np.uint64, end: np.uint64, out: Floats,
    facing: Floats,
) -> None:
    """Read height and slopes from row to row, and the cosine of the normal to the z axis."""
    columns = np.uint64(len(facing))
    for k in range(_3):
        _mix(upper, lower, down, k * columns + first, k * columns + end, out)
    for j in range(first, end):
        dx, dy = out[columns + j], out[_2 * columns + j]
        facing[j] = np.float32(1) / np.sqrt(dx * dx + dy * dy + np.float32(1))


@compiled
def _mix_colors(
    upper: Floats, lower: Floats, down: np.float32, first: np.uint64, end: np.uint64,
    out: NDArray[np.uint8],
) -> None:
    """Read colours from row to row, rounded."""
    for j in range(_3 * first, _3 * end):
        out[j] = np.uint8(np.int32(upper[j] + down * (lower[j] - upper[j]) + np.float32(0.5)))


@compiled
def _write_points(
    x: Floats, y: np.float32, heights: Floats, first: np.uint64, stop: np.uint64, out: Floats,
    i: np.uint64,
) -> None:
    """Write (x, y, z) of some columns from the i-th point on."""
    for j in range(stop - first):
        out[_3 * (i + j)] = x[first + j]
        out[_3 * (i + j) + _1] = y
        out[_3 * (i + j) + _2] = heights[first + j]


@compiled
def _write_normals(
    surface: Floats, facing: Floats, first: np.uint64, stop: np.uint64, out: Floats, i: np.uint64
) -> None:
    """Write unit normals toward the camera from the i-th point on."""
    dx = np.uint64(len(facing)) + first
    dy = np.uint64(len(facing)) + dx
    for j in range(stop - first):
        out[_3 * (i + j)] = surface[dx + j] * facing[first + j]
        out[_3 * (i + j) + _1] = surface[dy + j] * facing[first + j]
        out[_3 * (i + j) + _2] = -facing[first + j]


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
def indices_of_zeros(
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
