"""The loops of detection over the registered depth, compiled."""

import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.numerics.jit import compiled


@compiled
def fill_layers(
    pixels: Floats, color_depth: Floats, visible: Bools, edges: Doubles, cell: float, filled: Bytes
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
def nearest_in_cells(
    pixels: Floats, color_depth: Floats, visible: Bools, cell: float, nearest: Floats
) -> None:
    """Lower each of the (rows, columns) cells to the nearest depth in it, mm."""
    rows, columns = nearest.shape
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            if visible[i, j]:
                row = min(int((pixels[i, j, 1] + 0.5) / cell), rows - 1)
                column = min(int((pixels[i, j, 0] + 0.5) / cell), columns - 1)
                nearest[row, column] = min(nearest[row, column], color_depth[i, j])


@compiled
def depths_in_box(
    pixels: Floats, color_depth: Floats, visible: Bools,
    left: float, top: float, width: float, height: float,
) -> Doubles:
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
