"""A plane mesh cut along the line where a function is zero (marching triangles).

Values at corners are never zero, so that the line runs through edges alone, once through each that
it meets: it consists of closed curves that do not touch, and both sides are manifold. The diagonal
of squares is fixed: nothing is ambiguous, as it is with marching squares.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Ints

__all__ = ["Cut", "Mesh", "cut", "grid_mesh"]


class Mesh(NamedTuple):
    """Triangles in a plane, counter-clockwise seen from above.

    Attributes
    ----------
    values : (n, k) float64, of each corner: x, y and whatever is interpolated beside them
    triangles : (t, 3) int32, rows of `values`
    """

    values: NDArray[np.float64]
    triangles: Ints


class Cut(NamedTuple):
    """Both sides of a cut, on common corners.

    Attributes
    ----------
    values : (n, k) float64; those before the cut come first
    inside, outside : (t, 3) int32
    outline : (e, 2) int32, edges between both, the inside at the left
    """

    values: NDArray[np.float64]
    inside: Ints
    outside: Ints
    outline: Ints


def grid_mesh(values: NDArray[np.floating]) -> Mesh:
    """Join a grid's places, given as (rows, columns, k), with y decreasing along rows."""
    rows, columns = values.shape[:2]
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    triangles = np.stack([a, c, d, a, d, b], axis=-1).reshape(-1, 3)
    return Mesh(values.reshape(rows * columns, -1).astype(np.float64), triangles)


def cut(mesh: Mesh, levels: NDArray[np.floating]) -> Cut:
    """Cut a mesh where `levels`, (n,), one for each corner and none zero, changes its sign."""
    above = levels > 0
    counts = above[mesh.triangles].sum(axis=1)
    crossed = np.flatnonzero((counts == 1) | (counts == 2))
    corners = mesh.triangles[crossed]
    one_above = counts[crossed] == 1
    # The corner that is alone on its side comes first.
    alone = (above[corners] == one_above[:, None]).argmax(axis=1)
    p, q, r = (np.take_along_axis(corners, (alone[:, None] + k) % 3, axis=1)[:, 0]
               for k in range(3))
    ends = np.sort(np.stack([np.concatenate([p, p]), np.concatenate([q, r])], axis=1), axis=1)
    keys, numbers = np.unique(ends[:, 0] * np.int64(len(levels)) + ends[:, 1], return_inverse=True)
    low, high = np.divmod(keys, len(levels))
    share = levels[low] / (levels[low] - levels[high]).astype(np.float64)
    values = mesh.values[low] + share[:, None] * (mesh.values[high] - mesh.values[low])
    first, second = (numbers.astype(np.int32) + np.int32(len(levels))).reshape(2, -1)
    tip = np.stack([p, first, second], axis=1)
    rest = np.stack([first, q, r, first, r, second], axis=1).reshape(-1, 6)
    line = np.where(one_above[:, None], np.stack([first, second], axis=1),
                    np.stack([second, first], axis=1))

    def side(count: int, tips: NDArray[np.bool_]) -> Ints:
        return np.concatenate([mesh.triangles[counts == count], tip[tips],
                               rest[~tips].reshape(-1, 3)]).astype(np.int32)

    return Cut(np.concatenate([mesh.values, values]), side(3, one_above), side(0, ~one_above),
               line.astype(np.int32))
