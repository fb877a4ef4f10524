"""Connected components of a binary image, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["large_components"]


@compiled
def large_components(image: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Keep the parts, whose pixels touch at sides or corners, of at least so many pixels."""
    rows, columns = image.shape
    left = image.copy()
    kept = np.zeros((rows, columns), np.bool_)
    part = np.empty(np.count_nonzero(image), np.int64)
    for row in range(rows):
        for column in range(columns):
            if not left[row, column]:
                continue
            left[row, column] = False
            part[0] = row * columns + column
            done, count = 0, 1
            while done < count:
                i, j = part[done] // columns, part[done] % columns
                done += 1
                for k in range(max(i - 1, 0), min(i + 2, rows)):
                    for m in range(max(j - 1, 0), min(j + 2, columns)):
                        if left[k, m]:
                            left[k, m] = False
                            part[count] = k * columns + m
                            count += 1
            if count >= least:
                for k in range(count):
                    kept[part[k] // columns, part[k] % columns] = True
    return kept
