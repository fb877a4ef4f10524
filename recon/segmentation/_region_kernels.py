"""The loops over the depth image around a face, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = [
    "nearest_pixel",
    "principal_axis",
    "priority_flood",
    "row_medians",
    "square_mask",
    "superellipse_mask",
    "trim_below_drop",
    "trim_beside_rise",
    "trim_to_profile",
]

_EMPTY, _HIDDEN, _WANTED, _FOUND, _BLOCKED = 0, 1, 2, 3, 4


@compiled
def superellipse_mask(
    valid: NDArray[np.bool_], pixels: NDArray[np.float32], middle: tuple[float, float],
    reach: NDArray[np.float32],
) -> NDArray[np.bool_]:
    """Say which valid pixels are seen in a superellipse of power 2.5 about a place.

    That is between an ellipse (2) and the box itself: a head is round, and the corners of its box
    hold shoulders.

    pixels : (H, W, 2), where each is seen; middle : that place, (u, v)
    reach : (3,), sideward, upward, downward, pixels
    """
    rows, columns = valid.shape
    u, v = np.float32(middle[0]), np.float32(middle[1])
    inside = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if valid[row, column]:
                a = abs(pixels[row, column, 0] - u) / reach[0]
                d = pixels[row, column, 1] - v
                b = -d / reach[1] if d < 0 else d / reach[2]
                if a >= 1 or b >= 1:
                    continue
                inside[row, column] = a * a * np.sqrt(a) + b * b * np.sqrt(b) < 1
    return inside


@compiled
def square_mask(
    among: NDArray[np.bool_], pixels: NDArray[np.float32], middle: tuple[float, float],
    reach: float,
) -> NDArray[np.bool_]:
    """Say which pixels of some are seen in a square about a place, to `reach` pixels each way."""
    rows, columns = among.shape
    u, v, most = np.float32(middle[0]), np.float32(middle[1]), np.float32(reach)
    inside = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if among[row, column]:
                inside[row, column] = (abs(pixels[row, column, 0] - u) < most
                                       and abs(pixels[row, column, 1] - v) < most)
    return inside


@compiled
def nearest_pixel(
    among: NDArray[np.bool_], visible: NDArray[np.bool_], pixels: NDArray[np.float32],
    middle: tuple[float, float],
) -> tuple[int, int]:
    """Find the visible pixel of some that is seen nearest to a place; (-1, -1) where none is."""
    u, v = np.float32(middle[0]), np.float32(middle[1])
    least, found = np.float32(1e30), (-1, -1)
    for row in range(among.shape[0]):
        for column in range(among.shape[1]):
            if among[row, column] and visible[row, column]:
                a, b = pixels[row, column, 0] - u, pixels[row, column, 1] - v
                away = a * a + b * b
                if away < least:
                    least, found = away, (row, column)
    return found


@compiled
def row_medians(
    z: NDArray[np.float32], among: NDArray[np.bool_], every: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Give every so many of the rows that hold some, and the median of their z there."""
    rows, columns = among.shape
    at, medians = np.empty(rows, np.int64), np.empty(rows, np.float64)
    held = np.empty(columns, np.float32)
    seen = taken = 0
    for row in range(rows):
        count = 0
        for column in range(columns):
            if among[row, column]:
                held[count] = z[row, column]
                count += 1
        if count:
            if seen % every == 0:
                at[taken], medians[taken] = row, np.median(held[:count])
                taken += 1
            seen += 1
    return at[:taken], medians[:taken]


@compiled
def priority_flood(
    z: NDArray[np.float32],
    wanted: NDArray[np.bool_],
    hidden: NDArray[np.bool_],
    start_row: int,
    start_column: int,
    step: float,
    rise: float,
    reach: int,
    hidden_reach: int,
) -> NDArray[np.bool_]:
    """Follow a surface from one pixel to all that small steps connect with it.

    From each pixel it goes along the eight directions of the grid to the first that was measured
    (z > 0) and is not `hidden`, over at most `reach` - 1 others, `hidden_reach` - 1 where all are
    hidden: there, if it is wanted, if its depth differs by less than `step`, and if some way to it
    never went deeper than it by `rise`. Ways are followed in the order of their deepest point
    (priority flood, Barnes, Lehman, Mulla, 2014, doi:10.1016/j.cageo.2013.04.024).
    """
    rows, columns = z.shape
    nearest = farthest = z[start_row, start_column]
    # What a pixel is, with a border around, so that no step leaves the image.
    wide = columns + 2
    kind = np.full((rows + 2) * wide, _BLOCKED, np.uint8)
    depth = np.zeros((rows + 2) * wide, np.float32)
    for row in range(rows):
        for column in range(columns):
            here = z[row, column]
            at = (row + 1) * wide + column + 1
            if hidden[row, column]:
                kind[at] = _HIDDEN
            elif here <= 0:
                kind[at] = _EMPTY
            elif wanted[row, column]:
                kind[at] = _WANTED
                depth[at] = here
                nearest = min(nearest, here)
                farthest = max(farthest, here)
    # Pixels wait in lists, one for each millimetre of depth.
    low = int(nearest)
    size = int(farthest) - low + 1
    first = np.full(size, -1, np.int32)
    following = np.full(len(kind), -1, np.int32)
    level = int(z[start_row, start_column]) - low
    at = (start_row + 1) * wide + start_column + 1
    kind[at] = _FOUND
    first[level] = at
    while level < size:
        at = first[level]
        if at < 0:
            level += 1
            continue
        first[level] = following[at]
        here = depth[at]
        for down in (-wide, 0, wide):
            for way in range(down - 1, down + 2):
                place = at + way
                if kind[place] >= _FOUND:
                    continue
                gap, steps = 1, 1
                while kind[place] <= _HIDDEN and steps < hidden_reach:
                    if kind[place] == _EMPTY:
                        gap += 1
                        if gap > reach:
                            break
                    place += way
                    steps += 1
                if kind[place] != _WANTED:
                    continue
                there = depth[place]
                if abs(there - here) < step and there > level + low - rise:
                    kind[place] = _FOUND
                    bucket = max(level, int(there) - low)
                    following[place] = first[bucket]
                    first[bucket] = place
    found = np.empty((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            found[row, column] = kind[(row + 1) * wide + column + 1] == _FOUND
    return found


@compiled
def principal_axis(among: NDArray[np.bool_]) -> tuple[float, float]:
    """Give the direction, (down, right), in which some pixels reach farthest, by second moments.

    A unit vector that never points up; straight down where they reach alike in all directions.
    """
    count = rows_sum = columns_sum = 0
    for row in range(among.shape[0]):
        for column in range(among.shape[1]):
            if among[row, column]:
                count += 1
                rows_sum += row
                columns_sum += column
    down = right = both = 0.0
    for row in range(among.shape[0]):
        for column in range(among.shape[1]):
            if among[row, column]:
                a, b = row - rows_sum / count, column - columns_sum / count
                down += a * a
                right += b * b
                both += a * b
    angle = 0.5 * np.arctan2(2 * both, down - right)
    return np.cos(angle), np.sin(angle)


@compiled
def trim_to_profile(
    face: NDArray[np.bool_],
    z: NDArray[np.float32],
    pixels: NDArray[np.float32],
    front: float,
    middle: tuple[float, float],
    axis: tuple[float, float],
    below: NDArray[np.float64],
    behind: NDArray[np.float64],
) -> None:
    """Drop from `face` what lies deeper than front + a line through (below, behind).

    below : how far from the middle, (u, v), downward or along the axis, (down, right), a unit
        vector, whichever is more; pixels
    """
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            if face[row, column]:
                v = pixels[row, column, 1] - middle[1]
                v = max(v, axis[0] * v + axis[1] * (pixels[row, column, 0] - middle[0]))
                k = 0
                while k < len(below) and v >= below[k]:
                    k += 1
                if k == 0:
                    most = behind[0]
                elif k == len(below):
                    most = behind[-1]
                else:
                    share = (v - below[k - 1]) / (below[k] - below[k - 1])
                    most = behind[k - 1] + share * (behind[k] - behind[k - 1])
                face[row, column] = z[row, column] < front + most


@compiled
def trim_below_drop(
    face: NDArray[np.bool_], z: NDArray[np.float32], start_row: int, start_column: int,
    beyond: int, drop: float, reach: int,
) -> None:
    """Drop from `face` what lies behind a step down, on straight ways from a place.

    Ways lead down, at most as far aside; a step counts more than `beyond` rows below the place,
    where the depth grows by more than `drop` from one pixel of the face to the next on the way,
    at most `reach` pixels farther.
    """
    rows, columns = face.shape
    # Of the pixel before, on the way to each of a row: the last depth, how far back, and whether a
    # step was passed.
    last, gap = z[start_row].copy(), np.zeros(columns, np.int32)
    passed = np.zeros(columns, np.bool_)
    for row in range(start_row + 1, rows):
        down = row - start_row
        last_before, gap_before, passed_before = last.copy(), gap.copy(), passed.copy()
        for column in range(max(start_column - down, 0), min(start_column + down + 1, columns)):
            before = column - int(np.rint((column - start_column) / down))
            behind = passed_before[before]
            depth, away = last_before[before], gap_before[before] + 1
            if face[row, column]:
                here = z[row, column]
                if down > beyond and depth > 0 and away <= reach and here - depth > drop:
                    behind = True
                if behind:
                    face[row, column] = False
                depth, away = here, 0
            last[column], gap[column], passed[column] = depth, away, behind


@compiled
def trim_beside_rise(
    face: NDArray[np.bool_], z: NDArray[np.float32], start_row: int, start_column: int,
    beyond: int, rise: float,
) -> None:
    """Drop from `face` what comes nearer again, on straight ways to the sides of a place.

    Ways lead to the left and right, at most as far up or down; farther aside than `beyond` columns
    a way ends where it has been deeper by more than `rise`.
    """
    rows, columns = face.shape
    for side in (-1, 1):
        deepest, passed = np.zeros(rows, np.float32), np.zeros(rows, np.bool_)
        column, away = start_column + side, 1
        while 0 <= column < columns:
            deepest_before, passed_before = deepest.copy(), passed.copy()
            for row in range(max(start_row - away, 0), min(start_row + away + 1, rows)):
                before = row - int(np.rint((row - start_row) / away))
                depth, behind = deepest_before[before], passed_before[before]
                if face[row, column] and away > beyond:
                    behind = behind or z[row, column] < depth - rise
                    if behind:
                        face[row, column] = False
                    depth = max(depth, z[row, column])
                deepest[row], passed[row] = depth, behind
            column += side
            away += 1
