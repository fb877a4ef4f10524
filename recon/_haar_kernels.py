"""The loop of a Haar cascade over the windows of an image, compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["Trees", "flat_corners", "passing_windows"]

# Below this a window's standard deviation is too small to tell a pattern: 10 grey levels.
_LEAST_DEVIATION = 10.0

# Indices without a sign spare the compiler's question whether one counts from the end.
_0, _1, _2, _3, _4, _5 = (np.uint32(k) for k in range(6))
_6, _7, _8, _9, _10, _11 = (np.uint32(k) for k in range(6, 12))


class Trees(NamedTuple):
    """The decision trees of a cascade, all of the same size.

    Attributes
    ----------
    weights : (nodes, 3) float32, of a node's rectangles; the third is 0 where there are two
    thresholds : (nodes,) float32, of the weighted sum over the window's spread
    ways : (nodes, 2) int32; below its threshold a node goes the first way, else the second: to
        that node, or where negative to the leaf -1 - way
    leaves : float32
    stages : (stages + 1,) uint32, the first tree of each stage, and the number of all
    least : (stages,) float32, what the leaves of a stage must add up to
    """

    weights: NDArray[np.float32]
    thresholds: NDArray[np.float32]
    ways: NDArray[np.int32]
    leaves: NDArray[np.float32]
    stages: NDArray[np.uint32]
    least: NDArray[np.float32]


@compiled
def flat_corners(corners: NDArray[np.int32], stride: int) -> NDArray[np.uint32]:
    """Turn (nodes, 12, 2) x and y into offsets in rows of so many."""
    flat = np.empty(corners.shape[:2], np.uint32)
    for node in range(corners.shape[0]):
        for k in range(corners.shape[1]):
            flat[node, k] = corners[node, k, 0] + stride * corners[node, k, 1]
    return flat


@compiled
def passing_windows(
    image: NDArray[np.uint8], trees: Trees, corners: NDArray[np.uint32], stride: int, window: int,
    step: int, to_cells: NDArray[np.float64], wanted: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """Give the (n, 2) columns and rows of the windows that pass every stage.

    image : (H, W)
    corners : (nodes, 12), of each node's rectangles, offsets in rows of `stride`, more than W
    window : its side, pixels
    step : from one window to the next, pixels
    to_cells : (2, 3), from the middle of a window to column and row of `wanted`
    wanted : where the middle of a window may be
    """
    height, width = image.shape
    # Integral images: what is above and left of each corner of a pixel.
    flat = np.zeros((height + 1) * stride, np.int32)
    squares = np.zeros((height + 1, width + 1), np.int64)
    for y in range(height):
        row_sum, row_square = 0, 0
        for x in range(width):
            value = int(image[y, x])
            row_sum += value
            row_square += value * value
            flat[(y + 1) * stride + x + 1] = flat[y * stride + x + 1] + row_sum
            squares[y + 1, x + 1] = squares[y, x + 1] + row_square
    found = np.empty((height * width, 2), np.int32)
    count = 0
    weights, thresholds, ways, leaves, stages, least = trees
    nodes = len(thresholds) // stages[-1]
    inner = float((window - 2) ** 2)
    half = (window - 1) / 2
    for y in range(0, height + 1 - window, step):
        left_out = False
        for x in range(0, width + 1 - window, step):
            if left_out:
                left_out = False
                continue
            u, v = x + half, y + half
            column = int(np.floor(to_cells[0, 0] * u + to_cells[0, 1] * v + to_cells[0, 2]))
            row = int(np.floor(to_cells[1, 0] * u + to_cells[1, 1] * v + to_cells[1, 2]))
            if not (0 <= row < wanted.shape[0] and 0 <= column < wanted.shape[1]
                    and wanted[row, column]):
                continue
            top, left, bottom, right = y + 1, x + 1, y + window - 1, x + window - 1
            total = float(flat[bottom * stride + right] - flat[bottom * stride + left]
                          - flat[top * stride + right] + flat[top * stride + left])
            square = float(squares[bottom, right] - squares[bottom, left]
                           - squares[top, right] + squares[top, left])
            spread = inner * square - total * total
            if spread <= (_LEAST_DEVIATION * inner) ** 2:
                continue
            stage = _refused_by(
                flat, np.uint32(y * stride + x), np.float32(1 / np.sqrt(spread)), nodes, corners,
                weights, thresholds, ways, leaves, stages, least)
            if stage == len(least):
                found[count] = x, y
                count += 1
            # As OpenCV does: beside what the first stage refuses, one is left out.
            left_out = stage == 0
    return found[:count]


@compiled
def _refused_by(
    flat: NDArray[np.int32], at: np.uint32, scale: np.float32, nodes: int,
    corners: NDArray[np.uint32], weights: NDArray[np.float32], thresholds: NDArray[np.float32],
    ways: NDArray[np.int32], leaves: NDArray[np.float32], stages: NDArray[np.uint32],
    least: NDArray[np.float32],
) -> int:
    """Give the number of the stage that refuses the window, or that of all stages."""
    for stage in range(len(least)):
        score = np.float32(0)
        for tree in range(stages[stage], stages[stage + 1]):
            node = np.int32(tree * nodes)
            while node >= 0:
                n = np.uint32(node)
                value = weights[n, _0] * np.float32(
                    flat[at + corners[n, _0]] - flat[at + corners[n, _1]]
                    - flat[at + corners[n, _2]] + flat[at + corners[n, _3]])
                value += weights[n, _1] * np.float32(
                    flat[at + corners[n, _4]] - flat[at + corners[n, _5]]
                    - flat[at + corners[n, _6]] + flat[at + corners[n, _7]])
                if weights[n, _2] != 0:
                    value += weights[n, _2] * np.float32(
                        flat[at + corners[n, _8]] - flat[at + corners[n, _9]]
                        - flat[at + corners[n, _10]] + flat[at + corners[n, _11]])
                node = ways[n, _0 if value * scale < thresholds[n] else _1]
            score += leaves[np.uint32(-1 - node)]
        if score < least[stage]:
            return stage
    return len(least)
