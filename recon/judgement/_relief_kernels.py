"""The relief of a surface beside that of the mean face laid on it, compiled."""

import math

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.judgement._mould_kernels import OFF, Mould, in_mould, over_mould
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["compare"]

_RADIUS_MM = 85.0
"""What is taken off both radii, for the numbers' sake; turns angles into mm, too."""
_UNIT_MM = 60.0
"""Of the quadric's arguments, for the numbers' sake."""


@compiled
def compare(
    mould: Mould, points: Doubles, placement: Doubles, windows: Doubles, far_mm: float
) -> Doubles:
    """Compare the relief of points with the mean face's, in windows on the mean face.

    Relief is what the best quadric in angle and height leaves of the radius: a ball, a tin, a wall
    have next to none.

    points : (n, 3), mm
    windows : (w, 3), mm: half the width around the face, the upper and the lower end
    far_mm : larger distances from the mean face count as that

    Gives (w + 1, 3). For each window: the correlation of the points' relief with the mean face's,
    its gain (regression on it), and the points there. Last: root mean square distance from the
    mean face, mm, and the part of the points that lie on it.
    """
    count = len(windows)
    found = np.zeros((count + 1, 3))
    sums, own, mean = np.zeros((count, 6, 6)), np.zeros((count, 6)), np.zeros((count, 6))
    squares, term = np.zeros((count, 3)), np.ones(6)
    on, near, distance = 0, 0, 0.0
    for k in range(len(points)):
        x, y, z = in_mould(points[k], placement)
        e, _, _, _, angle, expected = over_mould(mould, x, y, z)
        if e >= OFF:
            continue
        on += 1
        e *= placement[12]
        distance += min(e * e, far_mm * far_mm)
        if abs(e) > far_mm:
            continue
        near += 1
        around = angle * _RADIUS_MM
        back = z - mould.axis_z
        out, expected = math.sqrt(x * x + back * back) - _RADIUS_MM, expected - _RADIUS_MM
        u, v = around / _UNIT_MM, y / _UNIT_MM
        term[1], term[2], term[3], term[4], term[5] = u, v, u * u, u * v, v * v
        for w in range(count):
            if abs(around) > windows[w, 0] or y < windows[w, 1] or y > windows[w, 2]:
                continue
            found[w, 2] += 1
            squares[w, 0] += out * out
            squares[w, 1] += out * expected
            squares[w, 2] += expected * expected
            for a in range(6):
                own[w, a] += term[a] * out
                mean[w, a] += term[a] * expected
                for b in range(6):
                    sums[w, a, b] += term[a] * term[b]
    for w in range(count):
        fit = solve_small(sums[w].copy(), own[w].copy())
        mean_fit = solve_small(sums[w].copy(), mean[w].copy())
        for a in range(6):
            squares[w, 0] -= own[w, a] * fit[a]
            squares[w, 1] -= mean[w, a] * fit[a]
            squares[w, 2] -= mean[w, a] * mean_fit[a]
        variance, mean_variance = max(squares[w, 0], 1e-3), max(squares[w, 2], 1e-3)
        found[w, 0] = squares[w, 1] / math.sqrt(variance * mean_variance)
        found[w, 1] = squares[w, 1] / mean_variance
    found[count, 0] = math.sqrt(distance / max(on, 1))
    found[count, 1] = near / len(points)
    return found
