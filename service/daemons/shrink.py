"""Small pictures of large ones."""

import numpy as np
from numpy.typing import NDArray

from denseface.service.protocol.payload import MAX_PREVIEW_SIDE

__all__ = ["shrunk"]


def shrunk(color: NDArray[np.uint8], longest: int = MAX_PREVIEW_SIDE) -> NDArray[np.uint8]:
    """Give (h, w, 3) uint8 with no side above `longest`: means over squares of whole pixels.

    Pixels at the right and lower edge that fill no square are left out.
    """
    side = -(-max(color.shape[:2]) // longest)
    if side == 1:
        return np.ascontiguousarray(color)
    rows, columns = (max(length // side, 1) for length in color.shape[:2])
    total = np.zeros((rows, columns, 3), np.uint32)
    steps = [min(side, length) for length in color.shape[:2]]
    for v in range(steps[0]):
        for u in range(steps[1]):
            total += color[v::side, u::side][:rows, :columns]
    means: NDArray[np.uint8] = (total // (steps[0] * steps[1])).astype(np.uint8)
    return means
