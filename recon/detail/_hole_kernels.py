"""Surfaces of least bending inside holes: their equations and their resampling, compiled."""

import math
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Bools, Doubles, Floats, Ints
from denseface.recon.numerics.jit import compiled

_RIDGE = 1e-4
"""Ridge toward the height at hand, in seeds, that keeps singular systems solvable."""
_STENCILS = np.array([[1.0, -2.0, 1.0, 0.0], [1.0, -2.0, 1.0, 0.0], [1.0, -1.0, -1.0, 1.0]])
"""Second differences along a row, along a column, and mixed."""
_STENCIL_WEIGHTS = np.array([1.0, 1.0, 2.0])
"""The mixed difference stands twice in the squared Hessian."""
_CUBIC_START = np.array([-2, -2, -1, -1])
"""First of the four cells, from the own, between which each point of a cell is interpolated."""
_CUBIC = np.array([[-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3,
                    t + 4 * t**2 - 3 * t**3, -t**2 + t**3]
                   for t in (0.625, 0.875, 0.125, 0.375)], np.float32) / 2
"""Their weights: cubic convolution, Keys, 1981, doi:10.1109/TASSP.1981.1163711."""


class Cells(NamedTuple):
    """The cells of a surface with holes, (rows, columns) each; no hole is near the outer two.

    counts, sums : float32, the seeds in each cell, and the sum of what they are off the height, mm
    heights : float32, mm
    added : float32, mm, what is added to the heights; changed where a hole is
    inside : bool, where there is a surface
    numbers : int32, the number of each unknown of the hole at hand, -1 elsewhere
    """

    counts: Floats
    sums: Floats
    heights: Floats
    added: Floats
    inside: Bools
    numbers: Ints


@compiled
def number_unknowns(labels: Ints, label: int, box: Ints, numbers: Ints) -> tuple[Ints, Ints]:
    """Number a hole's cells in `numbers`, and give their rows and columns, (n,) each.

    labels : (rows, columns), number of the hole that a cell is in
    box : (5,), left, top, width, height and size of this one
    """
    left, top, width, height, size = box
    rows, columns = np.empty(size, np.int32), np.empty(size, np.int32)
    number = 0
    for i in range(width * height):
        # Along the shorter side: neighbours' numbers are close, the matrix's band is narrow.
        r = top + (i % height if height < width else i // width)
        c = left + (i // height if height < width else i % width)
        if labels[r, c] == label:
            numbers[r, c] = number
            rows[number], columns[number] = r, c
            number += 1
    return rows, columns


@compiled
def bandwidth(rows: Ints, columns: Ints, numbers: Ints) -> int:
    """Give the largest difference of the numbers of cells that share a second difference."""
    band = 0
    for i in range(len(rows)):
        for down, right in ((2, 0), (0, 2), (1, 1), (1, -1), (1, 0), (0, 1)):
            other = numbers[rows[i] + down, columns[i] + right]
            if other >= 0:
                band = max(band, abs(other - i))
    return band


@compiled
def normal_equations(
    cells: Cells, rows: Ints, columns: Ints, box: Ints, band: int, smoothing: float, step: float
) -> tuple[Doubles, Doubles]:
    """Give the normal equations of a hole's unknowns, linearized about its slopes.

    smoothing : weight of the bending against the seeds' squares, mm^2 over mm^2
    step : from cell to cell, mm

    Gives (n, band + 1), the lower half of the matrix, its diagonal last, and the right side, (n,).
    """
    A, b = np.zeros((len(rows), band + 1)), np.empty(len(rows))
    for i in range(len(rows)):
        r, c = rows[i], columns[i]
        A[i, band] = cells.counts[r, c] + _RIDGE
        b[i] = cells.sums[r, c] + _RIDGE * cells.added[r, c]
    _, _, heights, added, inside, numbers = cells
    left, top, width, height, _ = box
    ids = np.empty(4, np.int32)
    for r in range(top - 1, top + height + 1):
        for c in range(left - 1, left + width + 1):
            dz_dx = (heights[r, c + 1] + added[r, c + 1]
                     - heights[r, c - 1] - added[r, c - 1]) / (2 * step)
            dz_dy = (heights[r + 1, c] + added[r + 1, c]
                     - heights[r - 1, c] - added[r - 1, c]) / (2 * step)
            squared = 1 + dz_dx * dz_dx + dz_dy * dz_dy
            weight = smoothing / (squared * squared * math.sqrt(squared))
            for kind in range(3):
                taps = 4 if kind == 2 else 3
                known, last, constant = True, -1, 0.0
                for k in range(taps):
                    y = r + (k >> 1 if kind == 2 else (k - 1) * kind)
                    x = c + (k & 1 if kind == 2 else (k - 1) * (1 - kind))
                    known &= inside[y, x]
                    ids[k] = numbers[y, x]
                    last = max(last, ids[k])
                    constant += _STENCILS[kind, k] * (
                        heights[y, x] + (np.float32(0) if ids[k] >= 0 else added[y, x]))
                if not known or last < 0:
                    continue
                for j in range(taps):
                    row = ids[j]
                    if row < 0:
                        continue
                    part = _STENCIL_WEIGHTS[kind] * weight * _STENCILS[kind, j]
                    b[row] -= part * constant
                    for k in range(taps):
                        if 0 <= ids[k] <= row:
                            A[row, band + ids[k] - row] += part * _STENCILS[kind, k]
    return A, b


@compiled
def resample_filled(added: Floats, labels: Ints, weight: Floats) -> tuple[Floats, Floats]:
    """Interpolate what cells say at four times as many points each way, by cubic convolution.

    added, labels : (rows, columns), of cells
    weight : (4 rows, 4 columns) or up to three fewer

    Gives the values times the weight, and the weight; both are zero where there is no hole.
    """
    filled, hole = np.zeros_like(weight), np.zeros_like(weight)
    for r in range(2, labels.shape[0] - 2):
        for c in range(2, labels.shape[1] - 2):
            if labels[r, c] == 0:
                continue
            for down in range(min(4, weight.shape[0] - 4 * r)):
                for right in range(min(4, weight.shape[1] - 4 * c)):
                    i, j = 4 * r + down, 4 * c + right
                    part = weight[i, j]
                    if part == 0:
                        continue
                    value = np.float32(0)
                    for y in range(4):
                        along = np.float32(0)
                        for x in range(4):
                            along += _CUBIC[right, x] * added[r + _CUBIC_START[down] + y,
                                                             c + _CUBIC_START[right] + x]
                        value += _CUBIC[down, y] * along
                    filled[i, j] = part * value
                    hole[i, j] = part
    return filled, hole
