"""The loops over the dense grid, compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats, Ints, Sizes
from denseface.recon.numerics.bilinear import column_positions
from denseface.recon.numerics.jit import compiled

# Unsigned indices spare the compiled code a test whether one counts from the end.
_0, _1, _3 = (np.uint64(k) for k in (0, 1, 3))


class Resampling(NamedTuple):
    """Planes to be read at the points of another grid, bilinear between their own.

    planes : (k, rows, columns) float32
    rows, columns : (m,), (n,) float32, where the other grid's are on theirs, inside it, rising
    """

    planes: Floats
    rows: Floats
    columns: Floats


class _Reader(NamedTuple):
    """A `Resampling` under way.

    left, part : (n,), `column_positions`
    lines : (3, k, n), the planes' even row at hand, the odd one, and what is between them
    """

    planes: Floats
    rows: Floats
    left: NDArray[np.uint32]
    part: Floats
    lines: Floats


@compiled
def gather_points(
    support: Bools, xs: Doubles, ys: Doubles, surface: Resampling, colors: Resampling,
    sigma: Resampling,
) -> tuple[Floats, Floats, Bytes, Floats, Ints]:
    """Gather the grid's supported points, row by row: points, normals, colours, sigma, cells.

    support : (m, k); xs, ys : (k,), (m,), mm
    surface : height, mm, dz/dx, dz/dy; colors : red, green, blue, 0-255; sigma : mm
    """
    rows, columns = support.shape
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    error = np.empty(n, np.float32)
    on_surface, in_color, off = _reader(surface), _reader(colors), _reader(sigma)
    s, c, e = on_surface.lines, in_color.lines, off.lines
    facing = np.empty(columns, np.float32)
    s_row, c_row, e_row = -2, -2, -2
    firsts, ends = _extents(support)
    i = _0
    for row in range(rows):
        s_row = _read_between(on_surface, row, s_row, firsts, ends)
        c_row = _read_between(in_color, row, c_row, firsts, ends)
        e_row = _read_between(off, row, e_row, firsts, ends)
        first, end = firsts[row], ends[row]
        for j in range(first, end):
            dx, dy = s[2, 1, j], s[2, 2, j]
            facing[j] = np.float32(1) / np.sqrt(dx * dx + dy * dy + np.float32(1))
        y = np.float32(ys[row])
        while first < end:
            stop = first
            while stop < end and support[row, stop]:
                stop += _1
            i -= first
            for j in range(first, stop):
                points[i + j, 0], points[i + j, 1], points[i + j, 2] = xs[j], y, s[2, 0, j]
            for j in range(first, stop):
                normals[i + j, 0] = s[2, 1, j] * facing[j]
                normals[i + j, 1] = s[2, 2, j] * facing[j]
                normals[i + j, 2] = -facing[j]
            for j in range(first, stop):
                for k in range(_3):
                    rgb[i + j, k] = np.uint8(np.int32(c[2, k, j] + np.float32(0.5)))
            for j in range(first, stop):
                error[i + j] = e[2, 0, j]
            for j in range(first, stop):
                cells[i + j, 0], cells[i + j, 1] = row, j
            i += stop
            first = stop
            while first < end and not support[row, first]:
                first += _1
    return points, normals, rgb, error, cells


@compiled
def _reader(source: Resampling) -> _Reader:
    """Make room to read."""
    left, part = column_positions(source.columns, source.planes.shape[2])
    return _Reader(source.planes, source.rows, left, part,
                   np.empty((3, len(source.planes), len(left)), np.float32))


@compiled
def _read_between(reader: _Reader, row: int, known: int, firsts: Sizes, ends: Sizes) -> int:
    """Read the planes at a row of the other grid; give the upper one of their rows at hand.

    known : what was given for the row before, -2 before any
    firsts, ends : `_extents`
    """
    planes, places, left, part, lines = reader
    above: int = min(int(places[row]), planes.shape[1] - 2)
    if above != known:
        # As far as any row needs it that lies between these two or the next.
        first, end, behind = firsts[row], ends[row], row + 1
        while behind < len(places) and places[behind] < above + 2:
            first, end = min(first, firsts[behind]), max(end, ends[behind])
            behind += 1
        for line in range(above if above != known + 1 else above + 1, above + 2):
            for k in range(len(planes)):
                for j in range(first, end):
                    here = planes[k, line, left[j]]
                    lines[line & 1, k, j] = here + part[j] * (planes[k, line, left[j] + _1] - here)
    upper, lower, down = above & 1, 1 - (above & 1), places[row] - np.float32(above)
    for k in range(len(planes)):
        for j in range(firsts[row], ends[row]):
            lines[2, k, j] = lines[upper, k, j] + down * (lines[lower, k, j] - lines[upper, k, j])
    return above


@compiled
def _extents(support: Bools) -> tuple[Sizes, Sizes]:
    """Give each row's first supported column, and the first behind all of them.

    Where a row has none these are the number of columns and 0.
    """
    rows, columns = support.shape
    firsts, ends = np.full(rows, columns, np.uint64), np.zeros(rows, np.uint64)
    for row in range(rows):
        first, end = _0, np.uint64(columns)
        while first < end and not support[row, first]:
            first += _1
        while end > first and not support[row, end - _1]:
            end -= _1
        if end > first:
            firsts[row], ends[row] = first, end
    return firsts, ends


@compiled
def indices_of_zeros(image: Bytes, rows: Floats, columns: Floats, cells: Ints) -> NDArray[np.int64]:
    """Give the indices of the cells at whose places an image, to the nearest pixel, is zero.

    rows, columns : (m,), (k,), where in the image the cells' rows and columns are, inside it
    """
    row = (rows + np.float32(0.5)).astype(np.uint32)
    column = (columns + np.float32(0.5)).astype(np.uint32)
    out = np.empty(len(cells), np.int64)
    count = 0
    for i in range(len(cells)):
        out[count] = i
        if image[row[np.uint32(cells[i, 0])], column[np.uint32(cells[i, 1])]] == 0:
            count += 1
    return out[:count].copy()
