"""Between scattered points and the pixels around them, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["BILINEAR_VARIANCE", "read_between", "share_out"]

BILINEAR_VARIANCE = 1 / 6
"""What bilinear weights blur by on average, squared pixels."""


@compiled
def share_out(
    columns: NDArray[np.float32], rows: NDArray[np.float32], values: NDArray[np.float32],
    image: NDArray[np.float32],
) -> None:
    """Add each value to the four pixels around its place, by bilinear weights.

    columns, rows : (n,), places inside `image`, not on its last row or column
    """
    for i in range(len(values)):
        left, above = int(columns[i]), int(rows[i])
        right_part, lower_part = columns[i] - np.float32(left), rows[i] - np.float32(above)
        lower = values[i] * lower_part
        upper = values[i] - lower
        image[above, left] += upper - upper * right_part
        image[above, left + 1] += upper * right_part
        image[above + 1, left] += lower - lower * right_part
        image[above + 1, left + 1] += lower * right_part


@compiled
def read_between(
    image: NDArray[np.float32], columns: NDArray[np.float32], rows: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Read an image at places, (n,), bilinear; places as of `share_out`."""
    out = np.empty(len(columns), np.float32)
    for i in range(len(columns)):
        left, above = int(columns[i]), int(rows[i])
        right_part, lower_part = columns[i] - np.float32(left), rows[i] - np.float32(above)
        upper = image[above, left] + right_part * (image[above, left + 1] - image[above, left])
        lower = image[above + 1, left] + right_part * (
            image[above + 1, left + 1] - image[above + 1, left])
        out[i] = upper + lower_part * (lower - upper)
    return out
