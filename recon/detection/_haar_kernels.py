"""The loop of a Haar cascade over the windows of an image, compiled and vectorised.

Neighbouring windows go through the cascade together, one in each lane of a vector: the corners of
their rectangles are neighbours in memory, and no branch depends on one window alone.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats, Ints, Sizes
from denseface.recon.numerics.jit import STACK_FLOATS, compiled, inlined, stack_floats

_MIN_DEVIATION = 10.0
"""Grey levels: windows of a smaller standard deviation show no pattern."""
_LANES = np.uint64(STACK_FLOATS)
"""Windows in a vector."""

# Unsigned indices: the compiler need not handle those that count from the end.
_0, _1, _2, _3, _4, _5 = (np.uint64(k) for k in range(6))
_6, _7, _8, _9, _10, _11 = (np.uint64(k) for k in range(6, 12))


class Trees(NamedTuple):
    """The decision trees of a cascade, all of one node or all of two."""

    weights: Floats
    """(nodes, 3), of a node's rectangles; the third is 0 where there are two."""
    thresholds: Floats
    """(nodes,), of the weighted sum by the window's standard deviation."""
    outcomes: Floats
    """(trees, 4), what a tree adds to its stage: where its first node is below its threshold and
    its last is, where the last is not, and the same where the first is not."""
    stages: NDArray[np.uint32]
    """(stages + 1,), the first tree of each stage, and the number of all."""
    stage_thresholds: Floats
    """(stages,), what the trees of a stage must add up to."""


class WindowGrid(NamedTuple):
    """How windows step over an image, and how its integral image lies in memory."""

    window: int
    """Side of a window, pixels."""
    step: int
    """From one window to the next, 1 or 2 pixels."""
    stride: int
    """Numbers in a row of the integral image, more than the image is wide and a multiple of `step`.
    A row holds every `step`-th column, then the others, so that what neighbouring windows read lies
    side by side."""


class _Integrals(NamedTuple):
    sums: Ints
    """Sum of the pixels above and left of each corner of a pixel, as laid out by the grid."""
    squares: NDArray[np.int64]
    """(H + 1, W + 1), the same of their squares."""


@compiled
def corner_offsets(corners: Ints, grid: WindowGrid) -> Sizes:
    """Turn (nodes, 12, 2) x and y of corners into offsets in the integral image."""
    offsets: Sizes = _column(corners[:, :, 0], grid) + grid.stride * corners[:, :, 1]
    return offsets.astype(np.uint64)


class WindowSizes(NamedTuple):
    """The sizes of window that are tried."""

    scales: Doubles
    """(sizes,), the window's side by the cascade's."""
    shapes: Ints
    """(sizes, 2), rows and columns of the image shrunk by it."""
    first_full: int
    """From this one on, windows are tried at every pixel of the shrunk image; before, at every
    second."""


@compiled
def windows_of_sizes(
    image: Bytes, trees: Trees, offsets: tuple[Sizes, Sizes], grid: WindowGrid,
    sizes: WindowSizes, to_cells: Doubles, allowed: Bools,
) -> Ints:
    """Give the (n, 3) column, row and size of the windows that pass every stage.

    image : (H, W)
    offsets : those of the corners of each node's rectangles, in grids of step 1 and 2
    grid : of step 1
    to_cells : (2, 3), from pixels to column and row of `allowed`
    allowed : where the centre of a window may be
    """
    buffer = np.empty(image.size, np.uint8)
    passed = []
    count = 0
    for size in range(len(sizes.scales)):
        rows, columns, scale = sizes.shapes[size, 0], sizes.shapes[size, 1], sizes.scales[size]
        small = buffer[:rows * columns].reshape(rows, columns)
        shrink_linearly(image, small)
        # Whole numbers are pixel centres.
        shrunk = to_cells.copy()
        shrunk[:, :2] *= scale
        shrunk[:, 2] += (to_cells[:, 0] + to_cells[:, 1]) * ((scale - 1) / 2)
        step = 1 if size >= sizes.first_full else 2
        found = passing_windows(small, trees, offsets[0] if step == 1 else offsets[1],
                                WindowGrid(grid.window, step, grid.stride), shrunk, allowed)
        passed.append(found)
        count += len(found)
    result = np.empty((count, 3), np.int32)
    at = 0
    for size in range(len(passed)):
        found = passed[size]
        result[at:at + len(found), :2] = found
        result[at:at + len(found), 2] = size
        at += len(found)
    return result


@compiled
def shrink_linearly(image: Bytes, small: Bytes) -> None:
    """Resize as OpenCV's INTER_LINEAR_EXACT does, with weights of eight bits."""
    height, width = image.shape
    rows, columns = small.shape
    left, weight = np.empty(columns, np.int32), np.empty(columns, np.int32)
    for x in range(columns):
        left[x], weight[x] = _between(x, width, columns)
    for y in range(rows):
        top, down = _between(y, height, rows)
        bottom = min(top + 1, height - 1)
        for x in range(columns):
            right = min(left[x] + 1, width - 1)
            above = (256 - weight[x]) * image[top, left[x]] + weight[x] * image[top, right]
            below = (256 - weight[x]) * image[bottom, left[x]] + weight[x] * image[bottom, right]
            small[y, x] = ((256 - down) * above + down * below + 32768) >> 16


@compiled
def _between(target: int, source_size: int, target_size: int) -> tuple[int, int]:
    """Give the pixel before a target pixel's middle, and the weight of the one after, of 256."""
    at = (target + 0.5) * source_size / target_size - 0.5
    first = int(np.floor(at))
    if first < 0:
        return 0, 0
    if first >= source_size - 1:
        return source_size - 1, 0
    return first, int(np.rint((at - first) * 256))


@compiled
def passing_windows(
    image: Bytes, trees: Trees, offsets: Sizes, grid: WindowGrid, to_cells: Doubles, allowed: Bools
) -> Ints:
    """Give the (n, 2) columns and rows of the windows that pass every stage.

    image : (H, W)
    offsets : (nodes, 12), those of the corners of each node's rectangles
    to_cells : (2, 3), from pixels to column and row of `allowed`
    allowed : where the centre of a window may be
    """
    height, width = image.shape
    integrals = _integral_images(image, grid)
    sums = integrals.sums
    windows = (width - grid.window) // grid.step + 1
    scale = np.zeros(windows + STACK_FLOATS, np.float32)
    rejected_by = np.empty(windows + STACK_FLOATS, np.int32)
    found = np.empty((height * width, 2), np.int32)
    count = 0
    for y in range(0, height + 1 - grid.window, grid.step):
        _set_scales(scale[:windows], y, integrals, grid, to_cells, allowed)
        k = 0
        while k < windows:
            if scale[k] == 0:
                k += 1
                continue
            _run_stages(sums, np.uint64(y * grid.stride + k), scale[k:k + STACK_FLOATS], trees,
                        offsets, rejected_by[k:k + STACK_FLOATS])
            k += STACK_FLOATS
        skipped = False
        for k in range(windows):
            if skipped:
                skipped = False
            elif scale[k] > 0:
                if rejected_by[k] == len(trees.stage_thresholds):
                    found[count, 0], found[count, 1] = k * grid.step, y
                    count += 1
                # As OpenCV does: the window after one that the first stage rejects is skipped.
                skipped = rejected_by[k] == 0
    return found[:count]


@compiled
def _column(x: Any, grid: WindowGrid) -> Any:
    """Give where a column, or each of an array, is in a row of the integral image."""
    odd = grid.step - 1
    return (x >> odd) + (grid.stride >> odd) * (x & odd)


@compiled
def _integral_images(image: Bytes, grid: WindowGrid) -> _Integrals:
    height, width = image.shape
    sums = np.zeros((height + 1) * grid.stride + STACK_FLOATS, np.int32)
    squares = np.zeros((height + 1, width + 1), np.int64)
    for y in range(height):
        row_sum, row_square = 0, 0
        for x in range(width):
            value = int(image[y, x])
            row_sum += value
            row_square += value * value
            at = y * grid.stride + _column(x + 1, grid)
            sums[at + grid.stride] = sums[at] + row_sum
            squares[y + 1, x + 1] = squares[y, x + 1] + row_square
    return _Integrals(sums, squares)


@compiled
def _set_scales(
    scale: Floats, y: int, integrals: _Integrals, grid: WindowGrid,
    to_cells: Doubles, allowed: Bools,
) -> None:
    """Set one over area and standard deviation of a row's windows; 0 where one is left out.

    As OpenCV does, over the window without its outermost pixels.
    """
    sums, squares = integrals
    window = grid.window
    area, half = float((window - 2) ** 2), (window - 1) / 2
    first, last = _column(1, grid), _column(window - 1, grid)
    for k in range(len(scale)):
        scale[k] = 0
        u, v = k * grid.step + half, y + half
        column = int(np.floor(to_cells[0, 0] * u + to_cells[0, 1] * v + to_cells[0, 2]))
        row = int(np.floor(to_cells[1, 0] * u + to_cells[1, 1] * v + to_cells[1, 2]))
        if not (0 <= row < allowed.shape[0] and 0 <= column < allowed.shape[1]
                and allowed[row, column]):
            continue
        top, bottom = (y + 1) * grid.stride + k, (y + window - 1) * grid.stride + k
        total = float(sums[bottom + last] - sums[bottom + first]
                      - sums[top + last] + sums[top + first])
        left, right = k * grid.step + 1, k * grid.step + window - 1
        square = float(squares[y + window - 1, right] - squares[y + window - 1, left]
                       - squares[y + 1, right] + squares[y + 1, left])
        variance = area * square - total * total  # times the squared area
        if variance > (_MIN_DEVIATION * area) ** 2:
            scale[k] = 1 / np.sqrt(variance)


@compiled
def _run_stages(
    sums: Ints, at: np.uint64, scale: Floats, trees: Trees, offsets: Sizes, rejected_by: Ints
) -> None:
    """Set the stage that rejects each of `STACK_FLOATS` windows, or the number of all stages.

    at : offset of the first window
    scale : (lanes,), of `_set_scales`; windows of 0 get -1
    """
    stages, stage_thresholds = trees.stages, trees.stage_thresholds
    nodes = len(trees.thresholds) // len(trees.outcomes)
    # On the stack: the compiler knows that it shares no memory, and vectorises.
    score = stack_floats()
    for k in range(_LANES):
        rejected_by[k] = len(stage_thresholds) if scale[k] > 0 else -1
    for stage in range(len(stage_thresholds)):
        for k in range(_LANES):
            score[k] = 0
        for tree in range(np.uint64(stages[stage]), np.uint64(stages[stage + 1])):
            if nodes == 1:
                _add_node(sums, at, offsets, trees, tree, scale, score)
            else:
                _add_nodes(sums, at, offsets, trees, tree, scale, score)
        left = 0
        for k in range(_LANES):
            if rejected_by[k] == len(stage_thresholds):
                if score[k] < stage_thresholds[stage]:
                    rejected_by[k] = stage
                else:
                    left += 1
        if left == 0:
            break


@inlined
def _add_node(
    sums: Ints, at: np.uint64, offsets: Sizes, trees: Trees, tree: int, scale: Floats, score: Floats
) -> None:
    """Add what a tree of one node says of each window."""
    weights, thresholds, outcomes, _, _ = trees
    threshold, below, above = thresholds[tree], outcomes[tree, _0], outcomes[tree, _2]
    if weights[tree, _2] == 0:
        for k in range(_LANES):
            value = scale[k] * _two_rectangles(sums, at + k, offsets, weights, tree)
            score[k] += below if value < threshold else above
    else:
        for k in range(_LANES):
            value = scale[k] * _three_rectangles(sums, at + k, offsets, weights, tree)
            score[k] += below if value < threshold else above


@inlined
def _add_nodes(
    sums: Ints, at: np.uint64, offsets: Sizes, trees: Trees, tree: int, scale: Floats, score: Floats
) -> None:
    """Add what a tree of two nodes says of each window."""
    weights, thresholds, outcomes, _, _ = trees
    first, last = _2 * tree, _2 * tree + _1
    first_threshold, last_threshold = thresholds[first], thresholds[last]
    o0, o1, o2, o3 = (
        outcomes[tree, _0], outcomes[tree, _1], outcomes[tree, _2], outcomes[tree, _3])
    if weights[first, _2] == 0 and weights[last, _2] == 0:
        for k in range(_LANES):
            a = scale[k] * _two_rectangles(sums, at + k, offsets, weights, first)
            b = scale[k] * _two_rectangles(sums, at + k, offsets, weights, last)
            below, above = o0 if b < last_threshold else o1, o2 if b < last_threshold else o3
            score[k] += below if a < first_threshold else above
    else:
        for k in range(_LANES):
            a = scale[k] * _three_rectangles(sums, at + k, offsets, weights, first)
            b = scale[k] * _three_rectangles(sums, at + k, offsets, weights, last)
            below, above = o0 if b < last_threshold else o1, o2 if b < last_threshold else o3
            score[k] += below if a < first_threshold else above


@inlined
def _two_rectangles(
    sums: Ints, at: np.uint64, offsets: Sizes, weights: Floats, node: np.uint64 | int
) -> np.float32:
    """Give the weighted sum over a node's first two rectangles."""
    value: np.float32 = (
        weights[node, _0] * np.float32(
            sums[at + offsets[node, _0]] - sums[at + offsets[node, _1]]
            - sums[at + offsets[node, _2]] + sums[at + offsets[node, _3]])
        + weights[node, _1] * np.float32(
            sums[at + offsets[node, _4]] - sums[at + offsets[node, _5]]
            - sums[at + offsets[node, _6]] + sums[at + offsets[node, _7]]))
    return value


@inlined
def _three_rectangles(
    sums: Ints, at: np.uint64, offsets: Sizes, weights: Floats, node: np.uint64 | int
) -> np.float32:
    """Give the weighted sum over a node's three rectangles."""
    value: np.float32 = (
        _two_rectangles(sums, at, offsets, weights, node)
        + weights[node, _2] * np.float32(
            sums[at + offsets[node, _8]] - sums[at + offsets[node, _9]]
            - sums[at + offsets[node, _10]] + sums[at + offsets[node, _11]]))
    return value
