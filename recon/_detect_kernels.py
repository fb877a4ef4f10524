"""The loops of detection over the registered depth, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["bulge_terms", "depths_in_box", "fill_layers"]


@compiled
def fill_layers(
    pixels: NDArray[np.float32], color_depth: NDArray[np.float32], visible: NDArray[np.bool_],
    edges: NDArray[np.float64], cell: float, filled: NDArray[np.uint8],
) -> None:
    """Set to 1, layer by layer of depth, the cells of the colour image that hold a depth.

    edges : (layers + 1,), mm, rising
    cell : side of a cell, pixels of the colour image
    filled : (layers, rows, columns)
    """
    layers, rows, columns = filled.shape
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            z = color_depth[i, j]
            if not visible[i, j] or z <= edges[0] or z > edges[layers]:
                continue
            layer = 0
            while z > edges[layer + 1]:
                layer += 1
            row = int((pixels[i, j, 1] + 0.5) / cell)
            column = int((pixels[i, j, 0] + 0.5) / cell)
            filled[layer, min(row, rows - 1), min(column, columns - 1)] = 1


@compiled
def depths_in_box(
    pixels: NDArray[np.float32], color_depth: NDArray[np.float32], visible: NDArray[np.bool_],
    left: float, top: float, width: float, height: float,
) -> NDArray[np.float64]:
    """Give the (n, 3) u, v and z of what the colour camera sees in a box.

    u and v are -1 and 1 at the sides of the box.
    """
    found = np.empty((visible.size, 3))
    count = 0
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            if not visible[i, j]:
                continue
            u = (pixels[i, j, 0] - left) / width * 2 - 1
            v = (pixels[i, j, 1] - top) / height * 2 - 1
            if abs(u) < 1 and abs(v) < 1:
                found[count, 0], found[count, 1], found[count, 2] = u, v, color_depth[i, j]
                count += 1
    return found[:count]


@compiled
def bulge_terms(
    depths: NDArray[np.float64], around_mm: float, reach_mm: float, fitted: NDArray[np.float64],
    before_mm: float, kept: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Give the normal equations of z - around = a + b u + c v + d (u^2 + v^2), and their number.

    kept : (n,), which depths are fitted; lowered here to those in the unit circle, less than
        `reach_mm` from `around_mm`, and not more than `before_mm` before what was `fitted` last
    """
    matrix, right = np.zeros((4, 4)), np.zeros(4)
    term = np.ones(4)
    count = 0
    for i in range(len(depths)):
        u, v, z = depths[i, 0], depths[i, 1], depths[i, 2] - around_mm
        squared = u * u + v * v
        term[1], term[2], term[3] = u, v, squared
        behind = z - (fitted[0] + fitted[1] * u + fitted[2] * v + fitted[3] * squared)
        kept[i] &= squared < 1 and abs(z) < reach_mm and behind > -before_mm
        if kept[i]:
            count += 1
            for row in range(4):
                right[row] += term[row] * z
                for column in range(4):
                    matrix[row, column] += term[row] * term[column]
    return matrix, right, count
