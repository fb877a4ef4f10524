"""The loop of a Haar cascade over the windows of an image, compiled.

Neighbouring windows go through the cascade side by side: the corners of their rectangles are
neighbours too, and nothing is asked of one window alone.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import STACK_FLOATS, compiled, inlined, stack_floats

__all__ = ["Trees", "flat_corners", "passing_windows"]

# Below this a window's standard deviation is too small to tell a pattern: 10 grey levels.
_LEAST_DEVIATION = 10.0
# So many windows side by side.
_LANES = np.uint64(STACK_FLOATS)

# Indices without a sign spare the compiler's question whether one counts from the end.
_0, _1, _2, _3, _4, _5 = (np.uint64(k) for k in range(6))
_6, _7, _8, _9, _10, _11 = (np.uint64(k) for k in range(6, 12))


class Trees(NamedTuple):
    """The decision trees of a cascade, all of one node or all of two.

    Attributes
    ----------
    weights : (nodes, 3) float32, of a node's rectangles; the third is 0 where there are two
    thresholds : (nodes,) float32, of the weighted sum over the window's spread
    outcomes : (trees, 4) float32, what a tree adds to its stage: where its first node is below its
        threshold and its last is, where the last is not, and the same where the first is not
    stages : (stages + 1,) uint32, the first tree of each stage, and the number of all
    least : (stages,) float32, what the trees of a stage must add up to
    """

    weights: NDArray[np.float32]
    thresholds: NDArray[np.float32]
    outcomes: NDArray[np.float32]
    stages: NDArray[np.uint32]
    least: NDArray[np.float32]


@compiled
def flat_corners(
    corners: NDArray[np.int32], stride: int, step: int
) -> NDArray[np.uint64]:
    """Turn (nodes, 12, 2) x and y into offsets in rows of so many, of columns sorted as below.

    step : 1 or 2
    """
    flat = np.empty(corners.shape[:2], np.uint64)
    part, odd = stride // step, step - 1
    for node in range(corners.shape[0]):
        for k in range(corners.shape[1]):
            x = corners[node, k, 0]
            flat[node, k] = (x >> odd) + part * (x & odd) + stride * corners[node, k, 1]
    return flat


@compiled
def passing_windows(
    image: NDArray[np.uint8], trees: Trees, corners: NDArray[np.uint64], stride: int, window: int,
    step: int, to_cells: NDArray[np.float64], wanted: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """Give the (n, 2) columns and rows of the windows that pass every stage.

    image : (H, W)
    corners : (nodes, 12), of each node's rectangles, offsets in rows of `stride`, more than W and a
        multiple of `step`: in them every `step`-th column of the integral image, then the next ones
    window : its side, pixels
    step : from one window to the next, 1 or 2 pixels
    to_cells : (2, 3), from the middle of a window to column and row of `wanted`
    wanted : where the middle of a window may be
    """
    height, width = image.shape
    part = stride // step
    # Integral images: what is above and left of each corner of a pixel.
    flat = np.zeros((height + 1) * stride + STACK_FLOATS, np.int32)
    squares = np.zeros((height + 1, width + 1), np.int64)
    for y in range(height):
        row_sum, row_square = 0, 0
        for x in range(width):
            value = int(image[y, x])
            row_sum += value
            row_square += value * value
            column = (x + 1) // step + part * ((x + 1) % step)
            flat[(y + 1) * stride + column] = flat[y * stride + column] + row_sum
            squares[y + 1, x + 1] = squares[y, x + 1] + row_square
    found = np.empty((height * width, 2), np.int32)
    count = 0
    inner = float((window - 2) ** 2)
    half = (window - 1) / 2
    windows = (width - window) // step + 1
    scale = np.zeros(windows + STACK_FLOATS, np.float32)
    refused = np.empty(windows + STACK_FLOATS, np.int32)
    one, last = (window - 1) // step + part * ((window - 1) % step), 1 // step + part * (1 % step)
    for y in range(0, height + 1 - window, step):
        # Where a window is left out, its scale is 0.
        for k in range(windows):
            scale[k] = 0
            u, v = k * step + half, y + half
            column = int(np.floor(to_cells[0, 0] * u + to_cells[0, 1] * v + to_cells[0, 2]))
            row = int(np.floor(to_cells[1, 0] * u + to_cells[1, 1] * v + to_cells[1, 2]))
            if not (0 <= row < wanted.shape[0] and 0 <= column < wanted.shape[1]
                    and wanted[row, column]):
                continue
            top, bottom = (y + 1) * stride + k, (y + window - 1) * stride + k
            total = float(flat[bottom + one] - flat[bottom + last]
                          - flat[top + one] + flat[top + last])
            left, right = k * step + 1, k * step + window - 1
            square = float(squares[y + window - 1, right] - squares[y + window - 1, left]
                           - squares[y + 1, right] + squares[y + 1, left])
            spread = inner * square - total * total
            if spread > (_LEAST_DEVIATION * inner) ** 2:
                scale[k] = 1 / np.sqrt(spread)
        k = 0
        while k < windows:
            if scale[k] == 0:
                k += 1
                continue
            _refuse(flat, np.uint64(y * stride + k), scale[k:k + STACK_FLOATS], trees, corners,
                    refused[k:k + STACK_FLOATS])
            k += STACK_FLOATS
        left_out = False
        for k in range(windows):
            if left_out:
                left_out = False
            elif scale[k] > 0:
                if refused[k] == len(trees.least):
                    found[count] = k * step, y
                    count += 1
                # As OpenCV does: beside what the first stage refuses, one is left out.
                left_out = refused[k] == 0
    return found[:count]


@compiled
def _refuse(
    flat: NDArray[np.int32], at: np.uint64, scale: NDArray[np.float32], trees: Trees,
    corners: NDArray[np.uint64], refused: NDArray[np.int32],
) -> None:
    """Tell of windows side by side which stage refuses each, or the number of all stages.

    at : where the first begins
    scale : (lanes,), one over the spread of each; 0 where it does not matter
    """
    weights, thresholds, outcomes, stages, least = trees
    nodes = len(thresholds) // len(outcomes)
    # The compiler knows that nothing else is there, and takes all lanes at once.
    score = stack_floats()
    for k in range(_LANES):
        refused[k] = len(least) if scale[k] > 0 else -1
    for stage in range(len(least)):
        for k in range(_LANES):
            score[k] = 0
        for tree in range(np.uint64(stages[stage]), np.uint64(stages[stage + 1])):
            if nodes == 1:
                _add_node(flat, at, corners, weights, thresholds, outcomes, tree, scale, score)
            else:
                _add_nodes(flat, at, corners, weights, thresholds, outcomes, tree, scale, score)
        left = 0
        for k in range(_LANES):
            if refused[k] == len(least):
                if score[k] < least[stage]:
                    refused[k] = stage
                else:
                    left += 1
        if left == 0:
            break


@inlined
def _add_node(
    flat: NDArray[np.int32], at: np.uint64, corners: NDArray[np.uint64],
    weights: NDArray[np.float32], thresholds: NDArray[np.float32],
    outcomes: NDArray[np.float32], tree: int, scale: NDArray[np.float32],
    score: NDArray[np.float32],
) -> None:
    """Add what a tree of one node says of each window."""
    least, below, above = thresholds[tree], outcomes[tree, _0], outcomes[tree, _2]
    if weights[tree, _2] == 0:
        for k in range(_LANES):
            value = scale[k] * _of_two(flat, at + k, corners, weights, tree)
            score[k] += below if value < least else above
    else:
        for k in range(_LANES):
            value = scale[k] * _of_three(flat, at + k, corners, weights, tree)
            score[k] += below if value < least else above


@inlined
def _add_nodes(
    flat: NDArray[np.int32], at: np.uint64, corners: NDArray[np.uint64],
    weights: NDArray[np.float32], thresholds: NDArray[np.float32],
    outcomes: NDArray[np.float32], tree: int, scale: NDArray[np.float32],
    score: NDArray[np.float32],
) -> None:
    """Add what a tree of two nodes says of each window."""
    first, last = _2 * tree, _2 * tree + _1
    one, other = thresholds[first], thresholds[last]
    o0, o1, o2, o3 = (
        outcomes[tree, _0], outcomes[tree, _1], outcomes[tree, _2], outcomes[tree, _3])
    if weights[first, _2] == 0 and weights[last, _2] == 0:
        for k in range(_LANES):
            a = scale[k] * _of_two(flat, at + k, corners, weights, first)
            b = scale[k] * _of_two(flat, at + k, corners, weights, last)
            below, above = o0 if b < other else o1, o2 if b < other else o3
            score[k] += below if a < one else above
    else:
        for k in range(_LANES):
            a = scale[k] * _of_three(flat, at + k, corners, weights, first)
            b = scale[k] * _of_three(flat, at + k, corners, weights, last)
            below, above = o0 if b < other else o1, o2 if b < other else o3
            score[k] += below if a < one else above


@inlined
def _of_two(
    flat: NDArray[np.int32], at: np.uint64, corners: NDArray[np.uint64],
    weights: NDArray[np.float32], node: np.uint64 | int,
) -> np.float32:
    """Give the weighted sum of a node's first two rectangles."""
    value: np.float32 = (
        weights[node, _0] * np.float32(
            flat[at + corners[node, _0]] - flat[at + corners[node, _1]]
            - flat[at + corners[node, _2]] + flat[at + corners[node, _3]])
        + weights[node, _1] * np.float32(
            flat[at + corners[node, _4]] - flat[at + corners[node, _5]]
            - flat[at + corners[node, _6]] + flat[at + corners[node, _7]]))
    return value


@inlined
def _of_three(
    flat: NDArray[np.int32], at: np.uint64, corners: NDArray[np.uint64],
    weights: NDArray[np.float32], node: np.uint64 | int,
) -> np.float32:
    """Give the weighted sum of a node's three rectangles."""
    value: np.float32 = _of_two(flat, at, corners, weights, node) + weights[node, _2] * np.float32(
        flat[at + corners[node, _8]] - flat[at + corners[node, _9]]
        - flat[at + corners[node, _10]] + flat[at + corners[node, _11]])
    return value
