"""Haar cascades, read from OpenCV's files and run over the windows that depth allows.

OpenCV's own loop knows no mask, and most of its time goes into windows in which depth says that
there is no face. The same windows pass here as there.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detection._haar_kernels import Trees, flat_corners, passing_windows
from denseface.recon.face import Box

__all__ = ["Cascade", "load_cascade", "passing_boxes"]

# What OpenCV takes off a stage's threshold for rounding.
_ROUNDING = 1e-5
# Windows up to twice the cascade's own are tried at every second pixel.
_COARSE_BELOW = 2.0
_MOST_NODES = 2


class Cascade(NamedTuple):
    """A cascade as OpenCV ships it.

    Attributes
    ----------
    window : side of the window, pixels
    trees : its stages
    corners : (nodes, 12, 2) int32, (x, y) of the corners of each node's three rectangles
    """

    window: int
    trees: Trees
    corners: NDArray[np.int32]


@cache
def load_cascade(name: str) -> Cascade:
    """Read one of the cascades that OpenCV ships; upright features, square windows."""
    path = Path(cv2.__file__).parent / "data" / f"{name}.xml"
    if not path.is_file():
        raise RuntimeError(f"{path}: OpenCV ships no such cascade (version 5 has none)")
    root = _part(ElementTree.parse(path).getroot(), "cascade")  # noqa: S314  OpenCV's own file
    rectangles = [[_numbers(one) for one in _part(feature, "rects")]
                  for feature in _part(root, "features")]
    nodes: list[NDArray[np.float64]] = []
    outcomes: list[list[float]] = []
    stages, least = [0], []
    for stage in _part(root, "stages"):
        weak = _part(stage, "weakClassifiers")
        for tree in weak:
            # left, right, feature, threshold; a way that is not positive is minus a leaf.
            rows = _numbers(_part(tree, "internalNodes")).reshape(-1, 4)
            outcomes.append(_outcomes(rows[:, :2].astype(int).tolist(),
                                      _numbers(_part(tree, "leafValues")).tolist()))
            nodes += list(rows)
        stages.append(stages[-1] + len(weak))
        least.append(float(_numbers(_part(stage, "stageThreshold"))[0]) - _ROUNDING)
    table = np.array(nodes)
    three = np.zeros((len(nodes), 3, 5))  # x, y, width, height, weight
    for three_of_node, feature in zip(three, table[:, 2].astype(int), strict=True):
        three_of_node[:len(rectangles[feature])] = rectangles[feature]
    x, y, w, h, weights = np.moveaxis(three, 2, 0)
    corners = np.stack([x, y, x + w, y, x, y + h, x + w, y + h], axis=2).reshape(-1, 12, 2)
    return Cascade(
        int(_numbers(_part(root, "width"))[0]),
        Trees(weights.astype(np.float32), table[:, 3].astype(np.float32),
              np.array(outcomes, np.float32),
              np.array(stages, np.uint32), np.array(least, np.float32)),
        corners.astype(np.int32))


def passing_boxes(
    gray: NDArray[np.uint8],
    cascade: Cascade,
    smallest: float,
    largest: float,
    scale_step: float,
    wanted: NDArray[np.bool_],
    to_cells: NDArray[np.float64],
) -> list[Box]:
    """Give each window of each size, between two widths, that passes all stages.

    Parameters
    ----------
    gray : (H, W) uint8
    cascade : which
    smallest, largest : widths, pixels of the image
    scale_step : from one width to the next
    wanted : (rows, columns) bool, the cells in which the middle of a window may be
    to_cells : (2, 3), from pixels of the image to columns and rows of `wanted`; a whole number is
        where a cell begins
    """
    height, width = gray.shape
    found = []
    stride = width + 1 + (width + 1) % 2
    corners: dict[int, NDArray[np.uint64]] = {}
    factor = 1.0
    while (side := round(cascade.window * factor)) <= min(largest, height, width):
        if side >= smallest:
            size = max(1, round(width / factor)), max(1, round(height / factor))
            small = gray if factor == 1 else np.asarray(
                cv2.resize(gray, size, interpolation=cv2.INTER_LINEAR_EXACT), np.uint8)
            # The middle of the window (x, y) is that of the box: (x + (side - 1) / 2) * factor, and
            # half of what a pixel has become wider.
            scaled = to_cells @ np.array(
                [[factor, 0, (factor - 1) / 2], [0, factor, (factor - 1) / 2], [0, 0, 1]])
            step = 1 if factor >= _COARSE_BELOW else 2
            if step not in corners:
                corners[step] = flat_corners(cascade.corners, stride, step)
            windows = passing_windows(small, cascade.trees, corners[step], stride,
                                      cascade.window, step, scaled, wanted)
            found += [(round(x * factor), round(y * factor), side, side)
                      for x, y in windows.tolist()]
        factor *= scale_step
    return found


def _outcomes(ways: list[list[int]], leaves: list[float]) -> list[float]:
    """Give `Trees.outcomes` of a tree of one node or two."""
    if len(ways) > _MOST_NODES:
        raise RuntimeError(f"a cascade's tree has {len(ways)} nodes, at most {_MOST_NODES} can be")
    return [leaves[-(way if way <= 0 else then)] for way in ways[0] for then in ways[-1]]


def _part(element: ElementTree.Element, name: str) -> ElementTree.Element:
    found = element.find(name)
    if found is None:
        raise RuntimeError(f"a cascade's file has no <{name}> in <{element.tag}>")
    return found


def _numbers(element: ElementTree.Element) -> NDArray[np.float64]:
    return np.array((element.text or "").split(), np.float64)
