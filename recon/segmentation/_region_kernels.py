"""The region of a face in the depth image: masks, its growth from a seed pixel, its limits.

Everything here is compiled. z : (H, W) float32, mm, 0 where nothing was measured; pixels :
(H, W, 2) float32, (u, v) of each depth pixel in the colour image.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.numerics.jit import compiled

# States of a pixel; those below _CANDIDATE are stepped over, those above it end a step.
_UNMEASURED, _OCCLUDED, _CANDIDATE, _VISITED, _BLOCKED = 0, 1, 2, 3, 4


class FloodLimits(NamedTuple):
    """How far a region grows from a pixel to its neighbour."""

    step: float
    """Largest difference of depth, mm."""
    rise: float
    """How much nearer the neighbour may be than the deepest pixel of the way to it, mm."""
    gap: int
    """Largest distance over unmeasured pixels, pixels."""
    occluded_gap: int
    """Largest distance over occluded pixels, pixels."""


@compiled
def superellipse_mask(
    valid: Bools, pixels: Floats, center: tuple[float, float], semi_axes: Floats
) -> Bools:
    """Mark the valid pixels seen in a superellipse of power 2.5, (H, W).

    That is between an ellipse (2) and a box: a head is round, and the corners of its box hold
    shoulders.

    center : (u, v), pixels; semi_axes : (3,), sideward, upward, downward, pixels
    """
    rows, columns = valid.shape
    u, v = np.float32(center[0]), np.float32(center[1])
    inside = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if valid[row, column]:
                a = abs(pixels[row, column, 0] - u) / semi_axes[0]
                d = pixels[row, column, 1] - v
                b = -d / semi_axes[1] if d < 0 else d / semi_axes[2]
                if a >= 1 or b >= 1:
                    continue
                inside[row, column] = a * a * np.sqrt(a) + b * b * np.sqrt(b) < 1
    return inside


@compiled
def square_mask(mask: Bools, pixels: Floats, center: tuple[float, float], reach: float) -> Bools:
    """Keep the pixels of a mask seen at most `reach` from (u, v), each way, (H, W)."""
    rows, columns = mask.shape
    u, v, most = np.float32(center[0]), np.float32(center[1]), np.float32(reach)
    inside = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if mask[row, column]:
                inside[row, column] = (abs(pixels[row, column, 0] - u) < most
                                       and abs(pixels[row, column, 1] - v) < most)
    return inside


@compiled
def nearest_pixel(
    mask: Bools, visible: Bools, pixels: Floats, center: tuple[float, float]
) -> tuple[int, int]:
    """Find the visible pixel of a mask that is seen nearest to (u, v); (-1, -1) where none is."""
    u, v = np.float32(center[0]), np.float32(center[1])
    least, found = np.float32(1e30), (-1, -1)
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] and visible[row, column]:
                a, b = pixels[row, column, 0] - u, pixels[row, column, 1] - v
                squared = a * a + b * b
                if squared < least:
                    least, found = squared, (row, column)
    return found


@compiled
def row_medians(z: Floats, mask: Bools, every: int) -> tuple[NDArray[np.int64], Doubles]:
    """Take every k-th of the rows that the mask is not empty in.

    Returns their indices, and the median of their masked z.
    """
    rows = np.array([row for row in range(len(mask)) if mask[row].any()])[::every]
    return rows, np.array([np.float64(np.median(z[row][mask[row]])) for row in rows])


@compiled
def priority_flood(
    z: Floats, candidates: Bools, occluded: Bools, start: tuple[int, int], limits: FloodLimits
) -> Bools:
    """Grow a region from a pixel over a surface, across small gaps and behind occluders.

    Neighbours are the next measured, not occluded pixels in the eight directions. Those among
    the candidates are taken in the order of the deepest pixel on the way to them, which makes
    that way the shallowest there is (priority flood, Barnes, Lehman and Mulla, 2014,
    doi:10.1016/j.cageo.2013.04.024).

    candidates, occluded : (H, W); start : (row, column)

    Returns the region, (H, W).
    """
    wide = z.shape[1] + 2
    step, rise, gap, occluded_gap = limits
    state, depth, nearest, farthest = _flood_states(z, candidates, occluded, z[start])
    # A bucket queue: one linked list of pixels for each millimetre of depth.
    low = int(nearest)
    heads = np.full(int(farthest) - low + 1, -1, np.int32)
    following = np.full(len(state), -1, np.int32)
    level = int(z[start]) - low
    at = (start[0] + 1) * wide + start[1] + 1
    state[at] = _VISITED
    heads[level] = at
    while level < len(heads):
        at = heads[level]
        if at < 0:
            level += 1
            continue
        heads[level] = following[at]
        here = depth[at]
        for down in (-wide, 0, wide):
            for way in range(down - 1, down + 2):
                place = at + way
                if state[place] >= _VISITED:
                    continue
                unmeasured, steps = 1, 1
                while state[place] <= _OCCLUDED and steps < occluded_gap:
                    if state[place] == _UNMEASURED:
                        unmeasured += 1
                        if unmeasured > gap:
                            break
                    place += way
                    steps += 1
                if state[place] != _CANDIDATE:
                    continue
                there = depth[place]
                if abs(there - here) < step and there > level + low - rise:
                    state[place] = _VISITED
                    bucket = max(level, int(there) - low)
                    following[place] = heads[bucket]
                    heads[bucket] = place
    region: Bools = state.reshape(-1, wide)[1:-1, 1:-1] == _VISITED
    return region


@compiled
def _flood_states(
    z: Floats, candidates: Bools, occluded: Bools, start_z: np.float32
) -> tuple[Bytes, Floats, np.float32, np.float32]:
    """Give each pixel's state and candidate depth, flat with a blocked border, and their range."""
    rows, columns = z.shape
    wide = columns + 2
    nearest = farthest = start_z
    state = np.full((rows + 2) * wide, _BLOCKED, np.uint8)
    depth = np.zeros((rows + 2) * wide, np.float32)
    for row in range(rows):
        for column in range(columns):
            here = z[row, column]
            at = (row + 1) * wide + column + 1
            if occluded[row, column]:
                state[at] = _OCCLUDED
            elif here <= 0:
                state[at] = _UNMEASURED
            elif candidates[row, column]:
                state[at] = _CANDIDATE
                depth[at] = here
                nearest = min(nearest, here)
                farthest = max(farthest, here)
    return state, depth, nearest, farthest


@compiled
def principal_axis(mask: Bools) -> tuple[float, float]:
    """Give the direction of a mask's largest second moment, (down, right).

    A unit vector that never points up; straight down where no direction is longer.
    """
    count = down = right = both = squares = 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column]:
                count += 1
                down += row
                right += column
                both += row * column
                squares += row * row - column * column
    # Whole numbers, exact: the moments about the mean, times the squared count.
    angle = 0.5 * np.arctan2(2 * (count * both - down * right),
                             count * squares - (down * down - right * right))
    return np.cos(angle), np.sin(angle)


@compiled
def trim_to_profile(
    face: Bools, z: Floats, pixels: Floats, front: float, center: tuple[float, float],
    axis: tuple[float, float], profile: tuple[Doubles, Doubles],
) -> None:
    """Drop from `face` what lies deeper than `front` by more than a profile allows.

    center : (u, v), pixels; axis : (down, right), unit vector
    profile : (n,) distances below the center, downward or along the axis, whichever is more,
        pixels, rising; (n,) depths allowed there, mm; linear between, constant outside
    """
    below, behind = profile
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            if face[row, column]:
                v = pixels[row, column, 1] - center[1]
                v = max(v, axis[0] * v + axis[1] * (pixels[row, column, 0] - center[0]))
                v = min(max(v, below[0]), below[-1])
                k = 1
                while k < len(below) - 1 and v > below[k]:
                    k += 1
                weight = (v - below[k - 1]) / (below[k] - below[k - 1])
                most = behind[k - 1] + weight * (behind[k] - behind[k - 1])
                face[row, column] = z[row, column] < front + most


@compiled
def trim_below_drop(
    face: Bools, z: Floats, start: tuple[int, int], least_rows: int, drop: float, gap: int
) -> None:
    """Drop from `face` what straight rays downward meet behind a step in depth: neck, chest.

    Rays start at (row, column) and lead down, at most 45 degrees aside. A step is a growth of
    depth by more than `drop`, mm, between pixels of the face on a ray at most `gap` rows apart; it
    counts more than `least_rows` below the start.
    """
    rows, columns = face.shape
    # Of the ray through each pixel of the row before: its last depth, how many rows ago that was,
    # and whether it has passed a step.
    last, age = z[start[0]].copy(), np.zeros(columns, np.int32)
    passed = np.zeros(columns, np.bool_)
    for row in range(start[0] + 1, rows):
        down = row - start[0]
        last_before, age_before, passed_before = last.copy(), age.copy(), passed.copy()
        for column in range(max(start[1] - down, 0), min(start[1] + down + 1, columns)):
            before = column - int(np.rint((column - start[1]) / down))
            behind = passed_before[before]
            depth, away = last_before[before], age_before[before] + 1
            if face[row, column]:
                here = z[row, column]
                if down > least_rows and depth > 0 and away <= gap and here - depth > drop:
                    behind = True
                if behind:
                    face[row, column] = False
                depth, away = here, 0
            last[column], age[column], passed[column] = depth, away, behind


@compiled
def trim_beside_rise(
    face: Bools, z: Floats, start: tuple[int, int], least_columns: int, rise: float
) -> None:
    """Drop from `face` what comes nearer again on straight rays sideways: another head.

    Rays start at (row, column) and lead left and right, at most 45 degrees up or down. Farther
    aside than `least_columns` a ray ends where it has been deeper by more than `rise`, mm.
    """
    rows, columns = face.shape
    for side in (-1, 1):
        deepest, passed = np.zeros(rows, np.float32), np.zeros(rows, np.bool_)
        column, away = start[1] + side, 1
        while 0 <= column < columns:
            deepest_before, passed_before = deepest.copy(), passed.copy()
            for row in range(max(start[0] - away, 0), min(start[0] + away + 1, rows)):
                before = row - int(np.rint((row - start[0]) / away))
                depth, behind = deepest_before[before], passed_before[before]
                if face[row, column] and away > least_columns:
                    behind = behind or z[row, column] < depth - rise
                    if behind:
                        face[row, column] = False
                    depth = max(depth, z[row, column])
                deepest[row], passed[row] = depth, behind
            column += side
            away += 1
