"""Haar cascades, read from OpenCV's files and run over the windows that depth allows.

OpenCV's own loop takes no mask, and most of its time goes into windows in which depth says that
there is no face. The same windows pass here as there.
"""

from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Ints, Sizes
from denseface.recon.detection._haar_kernels import (
    Trees,
    WindowGrid,
    WindowSizes,
    corner_offsets,
    windows_of_sizes,
)
from denseface.recon.face import Box

_THRESHOLD_SLACK = 1e-5
"""What OpenCV takes off a stage's threshold for rounding."""
_FULL_STEP_SCALE = 2.0
"""From this scale on, windows are tried at every pixel; below at every second, as in OpenCV."""
_STRIDE_STEP = 32
"""Rows of integral images are as long as a multiple of that, so that few lengths occur."""
_MOST_GRIDS = 64
"""Grids whose offsets are kept: 0.2 MB each."""
_MAX_NODES = 2
"""Nodes of a tree."""


class Cascade(NamedTuple):
    """A cascade as OpenCV ships it."""

    window: int
    """Side of the window, pixels."""
    trees: Trees
    corners: Ints
    """(nodes, 12, 2), (x, y) of the corners of each node's three rectangles."""
    offsets: dict[WindowGrid, Sizes]
    """Those corners in the integral images of the grids that were asked for so far."""


@cache
def load_cascade(name: str) -> Cascade:
    """Read one of the cascades that OpenCV ships; upright features, square windows.

    Raises
    ------
    RuntimeError
        OpenCV ships no such cascade, or its file is not as expected.
    """
    path = Path(cv2.__file__).parent / "data" / f"{name}.xml"
    if not path.is_file():
        raise RuntimeError(f"{path}: OpenCV ships no such cascade (version 5 has none)")
    root = _child(ElementTree.parse(path).getroot(), "cascade")  # noqa: S314  OpenCV's own file
    features = [_child(one, "rects") for one in _child(root, "features")]
    rectangles = np.zeros((len(features), 3, 5))  # x, y, width, height, weight
    given = np.arange(3) < np.array([len(rects) for rects in features])[:, None]
    rectangles[given] = _numbers(*(one for rects in features for one in rects)).reshape(-1, 5)
    stages = [_child(stage, "weakClassifiers") for stage in _child(root, "stages")]
    trees = [tree for stage in stages for tree in stage]
    # left, right, feature, threshold; a branch that is not positive is minus a leaf.
    texts = [_child(tree, "internalNodes") for tree in trees]
    table = _numbers(*texts).reshape(-1, 4)
    branches = iter(table[:, :2].astype(int).tolist())
    leaves = iter(_numbers(*(_child(tree, "leafValues") for tree in trees)).tolist())
    outcomes = []
    for text in texts:
        nodes = len((text.text or "").split()) // 4
        outcomes.append(_outcomes(list(islice(branches, nodes)), list(islice(leaves, nodes + 1))))
    x, y, w, h, weights = np.moveaxis(rectangles[table[:, 2].astype(int)], 2, 0)
    corners = np.stack([x, y, x + w, y, x, y + h, x + w, y + h], axis=2).reshape(-1, 12, 2)
    return Cascade(
        int(_numbers(_child(root, "width"))[0]),
        Trees(weights.astype(np.float32), table[:, 3].astype(np.float32),
              np.array(outcomes, np.float32),
              np.cumsum([0, *map(len, stages)]).astype(np.uint32),
              (_numbers(*(_child(stage, "stageThreshold") for stage in _child(root, "stages")))
               - _THRESHOLD_SLACK).astype(np.float32)),
        corners.astype(np.int32), {})


def passing_boxes(
    gray: Bytes, cascade: Cascade, size_limits: tuple[float, float], scale_step: float,
    allowed: Bools, to_cells: Doubles,
) -> list[Box]:
    """Give each window of each size that passes all stages.

    Parameters
    ----------
    gray : (H, W) uint8
    size_limits : smallest and largest width, pixels of the image
    scale_step : from one width to the next
    allowed : (rows, columns) bool, the cells in which the centre of a window may be
    to_cells : (2, 3), from pixels of the image to columns and rows of `allowed`; a whole number is
        where a cell begins
    """
    height, width = gray.shape
    smallest, largest = size_limits
    scales, scale = [], 1.0
    while (side := round(cascade.window * scale)) <= min(largest, height, width):
        if side >= smallest:
            scales.append(scale)
        scale *= scale_step
    if not scales:
        return []
    stride = -(-(width + 1) // _STRIDE_STEP) * _STRIDE_STEP
    sizes = WindowSizes(
        np.array(scales), np.array([(max(1, round(height / scale)), max(1, round(width / scale)))
                                    for scale in scales], np.int32),
        sum(scale < _FULL_STEP_SCALE for scale in scales))
    windows = windows_of_sizes(
        gray, cascade.trees,
        (_offsets(cascade, WindowGrid(cascade.window, 1, stride)),
         _offsets(cascade, WindowGrid(cascade.window, 2, stride))),
        WindowGrid(cascade.window, 1, stride), sizes, to_cells, allowed)
    sides = [round(cascade.window * scale) for scale in scales]
    return [(round(x * scales[size]), round(y * scales[size]), sides[size], sides[size])
            for x, y, size in windows.tolist()]


def _offsets(cascade: Cascade, grid: WindowGrid) -> Sizes:
    known = cascade.offsets.get(grid)
    if known is None:
        if len(cascade.offsets) >= _MOST_GRIDS:
            cascade.offsets.clear()
        known = cascade.offsets[grid] = corner_offsets(cascade.corners, grid)
    return known


def _outcomes(branches: list[list[int]], leaves: list[float]) -> list[float]:
    """Give `Trees.outcomes` of a tree of one node or two."""
    if len(branches) > _MAX_NODES:
        raise RuntimeError(
            f"a cascade's tree has {len(branches)} nodes, at most {_MAX_NODES} can be")
    return [leaves[-(branch if branch <= 0 else then)]
            for branch in branches[0] for then in branches[-1]]


def _child(element: ElementTree.Element, name: str) -> ElementTree.Element:
    found = element.find(name)
    if found is None:
        raise RuntimeError(f"a cascade's file has no <{name}> in <{element.tag}>")
    return found


def _numbers(*elements: ElementTree.Element) -> Doubles:
    """Read all that is in some elements, at once: they are tens of thousands."""
    return np.array(" ".join(one.text or "" for one in elements).split(), np.float64)
