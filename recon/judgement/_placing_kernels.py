"""The mean face laid on a surface: Gauss-Newton steps along its normals, compiled."""

import math

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.judgement._mould_kernels import OFF, Mould, in_mould, over_mould
from denseface.recon.numerics.jit import compiled, inlined
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["refine"]

_MOST_TURN, _MOST_GROWTH = 0.35, 0.2
"""Of one step: rad; and the logarithm of the scale's factor."""
_LEAST_SCALE, _MOST_SCALE = 0.55, 1.35
"""A small child's head, and a very large one, by the mean face."""
_TURN_STIFFNESS, _SHIFT_STIFFNESS = 5.0, 1e-3
"""For each point, mm^2 / rad^2 and 1: what the points leave open, as on a ball, stays as it is."""
_SCALE_STIFFNESS = 20.0
"""For each point, mm^2: draws the scale's logarithm toward 0."""


@compiled
def refine(mould: Mould, points: Doubles, placements: Doubles, steps: int, far_mm: float
           ) -> Doubles:
    """Move placements, in place, toward the least distance from points to the mean face.

    The weights are those of Geman and McClure, 1987.

    points : (n, 3), mm
    placements : (k, 13)
    far_mm : distances beyond that count little

    Gives (k,), mean robust costs, 0-1; a point beside the mean face costs 1.
    """
    matrix, right = np.empty((7, 7)), np.empty(7)
    rows, weighted = np.empty((8, len(points))), np.empty(len(points))
    weights = np.empty(len(points))
    costs, squared = np.empty(len(placements)), far_mm * far_mm
    for k in range(len(placements)):
        placement = placements[k]
        for step in range(steps + 1):
            cost, count = 0.0, 0
            for i in range(len(points)):
                x, y, z = in_mould(points[i], placement)
                e, nx, ny, nz, _, _ = over_mould(mould, x, y, z)
                if e >= OFF:
                    cost += 1
                    continue
                weight = squared / (squared + e * e)
                cost += 1 - weight
                if step == steps:
                    continue
                weights[count] = weight * weight
                rows[0, count], rows[1, count] = y * nz - z * ny, z * nx - x * nz
                rows[2, count] = x * ny - y * nx
                rows[3, count], rows[4, count], rows[5, count] = nx, ny, nz
                rows[6, count], rows[7, count] = x * nx + y * ny + z * nz, e
                count += 1
            costs[k] = cost / len(points)
            if step < steps:
                # Sums over all points at once are vectorised, a point's own products are not.
                for a in range(7):
                    one = rows[a]
                    for i in range(count):
                        weighted[i] = weights[i] * one[i]
                    for b in range(a, 8):
                        other, total = rows[b], 0.0
                        for i in range(count):
                            total += weighted[i] * other[i]
                        if b < 7:
                            matrix[a, b] = total
                        else:
                            right[a] = total
                _stiffen(matrix, right, len(points), placement[12])
                _move(placement, solve_small(matrix, right))
    return costs


@inlined
def _stiffen(matrix: Doubles, right: Doubles, points: int, scale: float) -> None:
    """Fill the lower half, and hold what the points do not tell."""
    for a in range(7):
        for b in range(a):
            matrix[a, b] = matrix[b, a]
    for a in range(3):
        matrix[a, a] += _TURN_STIFFNESS * points
        matrix[a + 3, a + 3] += _SHIFT_STIFFNESS * points
    matrix[6, 6] += _SCALE_STIFFNESS * points
    right[6] -= _SCALE_STIFFNESS * points * math.log(scale)


@inlined
def _move(p: Doubles, by: Doubles) -> None:
    """Take a turn, a shift and a growth, in the mean face's frame, off the points."""
    angle = math.sqrt(by[0] ** 2 + by[1] ** 2 + by[2] ** 2) + 1e-12
    ux, uy, uz = by[0] / angle, by[1] / angle, by[2] / angle
    angle = min(angle, _MOST_TURN)
    c, s = math.cos(angle), math.sin(angle)
    d = 1 - c
    t00, t01, t02 = c + ux * ux * d, ux * uy * d - uz * s, ux * uz * d + uy * s
    t10, t11, t12 = uy * ux * d + uz * s, c + uy * uy * d, uy * uz * d - ux * s
    t20, t21, t22 = uz * ux * d - uy * s, uz * uy * d + ux * s, c + uz * uz * d
    for a in range(3):
        r0, r1, r2 = p[3 * a], p[3 * a + 1], p[3 * a + 2]
        p[3 * a] = r0 * t00 + r1 * t10 + r2 * t20
        p[3 * a + 1] = r0 * t01 + r1 * t11 + r2 * t21
        p[3 * a + 2] = r0 * t02 + r1 * t12 + r2 * t22
        p[9 + a] += p[12] * (p[3 * a] * by[3] + p[3 * a + 1] * by[4] + p[3 * a + 2] * by[5])
    grown = p[12] * math.exp(min(max(by[6], -_MOST_GROWTH), _MOST_GROWTH))
    p[12] = min(max(grown, _LEAST_SCALE), _MOST_SCALE)
