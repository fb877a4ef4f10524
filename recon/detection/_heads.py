"""Where depth alone looks like a head: solid, rounded, with a rim that falls away; compiled.

Depth gives scale, so that every place is judged at the one size that a head has there. What is
asked holds for heads however turned, tipped or lit, and for few other things in a room.
"""

import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.intermediate import NO_DEPTH_MM
from denseface.recon.numerics.jit import compiled

_DIRECTIONS = 16
"""Samples on a circle."""
_INNER_MM = (25.0, 50.0)
"""Radii, about the middle of a face, of circles that lie on the head."""
_OUTER_MM = (70.0, 85.0)
"""Of circles along its outline: a face is half as wide as that, a head with its hair as high."""
_RIM_MM = (125.0, 155.0)
"""Of circles past it, but for the neck."""
_RADII = np.array(_INNER_MM + _OUTER_MM + _RIM_MM, np.float32)

_SOLID_MM = 60.0
"""What is on the head is no farther from its middle along z."""
_MIN_SOLID = 0.75
"""Share of the inner circles that is on it. About the middles of 120 simulated faces of the
choosing heads (yaw to 60, pitch to 30, roll to 40 degrees, a hand at the cheek, 0.5-1.8 m) at
least 0.86."""
_MOST_BEHIND_MM = 30.0
"""What is farther behind the middle counts as so far: an edge, with the room past it on one side,
is then no head."""
_MIN_INNER_MM = 6.5
"""How far two opposite points of the second circle must lie behind the middle, in the mean of both
and along one direction at least. Of the same faces the least has 10, boxes and walls nothing."""
_MIN_OUTER_MM = 6.5
"""The same for the outer circles, in the mean of all directions; there the least has 9.6, the
median 19."""
_BEHIND_MM = 40.0
"""What is farther than the middle by so much, or gives no reading, is past the head."""
_MIN_RIM = 0.45
"""Share of the circles past it that must be; of the same faces the least has 0.62, with the neck
and a shoulder before it. Another head beside it takes a quarter."""
_MIN_BOTH = 0.12
"""Share of opposite points on the circles past it both of which must be: at the edge of a table or
a cupboard one is. Of the same faces the least has 0.25."""
_MIN_PAIRS = 8
"""Of opposite points within the image, of sixteen on the outer circles."""


def head_like(
    nearest: Floats, cells_at_1_mm: float, nearest_mm: float, farthest_mm: float
) -> Bools:
    """Say of each cell whether the middle of a face can be in it.

    Parameters
    ----------
    nearest : (rows, columns) float32, mm, the nearest depth in each cell, or `NO_DEPTH_MM`
    cells_at_1_mm : cells to a millimetre at a distance of 1 mm
    nearest_mm, farthest_mm : range of depth in which it can be
    """
    angles = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    steps = _RADII[:, None, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    return _head_like(nearest, (steps * cells_at_1_mm).astype(np.float32),
                      np.float32(nearest_mm), np.float32(farthest_mm))


@compiled
def _head_like(
    nearest: Floats, steps: Floats, nearest_mm: np.float32, farthest_mm: np.float32
) -> Bools:
    """Judge every cell; steps : (circles, directions, 2), rows and columns at 1 mm."""
    rows, columns = nearest.shape
    found = np.zeros((rows, columns), np.bool_)
    behind = np.empty(steps.shape[:2], np.float32)
    for i in range(rows):
        for j in range(columns):
            if nearest_mm < nearest[i, j] <= farthest_mm:
                front = _front(nearest, i, j, steps, behind)
                found[i, j] = (_is_solid(nearest, i, j, steps, front, behind)
                               and _is_round(nearest, i, j, steps, front, behind)
                               and _has_rim(nearest, i, j, steps, front, behind))
    return found


@compiled
def _sample(
    nearest: Floats, i: int, j: int, steps: Floats, circle: int, front: float, behind: Floats
) -> None:
    """Set how far a circle's points lie behind `front`, mm; -`NO_DEPTH_MM` outside the image."""
    scale = 1 / nearest[i, j]
    for k in range(steps.shape[1]):
        row = int(np.floor(i + 0.5 + steps[circle, k, 0] * scale))
        column = int(np.floor(j + 0.5 + steps[circle, k, 1] * scale))
        inside = 0 <= row < nearest.shape[0] and 0 <= column < nearest.shape[1]
        behind[circle, k] = nearest[row, column] - front if inside else -NO_DEPTH_MM


@compiled
def _front(nearest: Floats, i: int, j: int, steps: Floats, behind: Floats) -> float:
    """Give the depth of a middle, of several readings, mm, and sample the first circle."""
    _sample(nearest, i, j, steps, 0, nearest[i, j], behind)
    middle, count = 0.0, 1
    for k in range(steps.shape[1]):
        if abs(behind[0, k]) < _SOLID_MM:
            middle += behind[0, k]
            count += 1
    middle /= count
    for k in range(steps.shape[1]):
        behind[0, k] -= middle
    front: float = nearest[i, j] + middle
    return front


@compiled
def _is_solid(
    nearest: Floats, i: int, j: int, steps: Floats, front: float, behind: Floats
) -> bool:
    """Judge the inner circles: on the head, and not flat."""
    solid = known = 0
    for circle in range(len(_INNER_MM)):
        if circle > 0:
            _sample(nearest, i, j, steps, circle, front, behind)
        for k in range(steps.shape[1]):
            # No reading, in an eye or in dark hair, says nothing.
            if abs(behind[circle, k]) < NO_DEPTH_MM / 2:
                known += 1
                solid += abs(behind[circle, k]) < _SOLID_MM
    half, most = steps.shape[1] // 2, 0.0
    for k in range(half):
        one, other = behind[len(_INNER_MM) - 1, k], behind[len(_INNER_MM) - 1, k + half]
        if min(one, other) > -NO_DEPTH_MM / 2:
            most = max(most, (min(one, _MOST_BEHIND_MM) + min(other, _MOST_BEHIND_MM)) / 2)
    return known > 0 and solid >= _MIN_SOLID * known and most >= _MIN_INNER_MM


@compiled
def _is_round(
    nearest: Floats, i: int, j: int, steps: Floats, front: float, behind: Floats
) -> bool:
    """Say whether opposite points lie behind the middle: a slanted plane's do not, in the mean."""
    half = steps.shape[1] // 2
    first, last = len(_INNER_MM), len(_INNER_MM) + len(_OUTER_MM)
    pairs, total = 0, 0.0
    for circle in range(first, last):
        _sample(nearest, i, j, steps, circle, front, behind)
        for k in range(half):
            one, other = behind[circle, k], behind[circle, k + half]
            if min(one, other) > -NO_DEPTH_MM / 2:
                pairs += 1
                total += (min(one, _MOST_BEHIND_MM) + min(other, _MOST_BEHIND_MM)) / 2
    return pairs >= _MIN_PAIRS and total >= _MIN_OUTER_MM * pairs


@compiled
def _has_rim(
    nearest: Floats, i: int, j: int, steps: Floats, front: float, behind: Floats
) -> bool:
    """Say whether enough of what is past a head lies behind it."""
    half = steps.shape[1] // 2
    past = known = both = pairs = 0
    for circle in range(len(steps) - len(_RIM_MM), len(steps)):
        _sample(nearest, i, j, steps, circle, front, behind)
        for k in range(half):
            one, other = behind[circle, k], behind[circle, k + half]
            known += (one > -NO_DEPTH_MM / 2) + (other > -NO_DEPTH_MM / 2)
            past += (one > _BEHIND_MM) + (other > _BEHIND_MM)
            pairs += min(one, other) > -NO_DEPTH_MM / 2
            both += min(one, other) > _BEHIND_MM
    return past > 0 and past >= _MIN_RIM * known and both >= _MIN_BOTH * pairs
