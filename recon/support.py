"""Where the seeds support a surface: over them and the holes they enclose, not past their rim."""

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.masks import disc, fill_holes

__all__ = ["support_on_grid"]

# In units of the mean spacing. Gaps narrower than twice the closing are none; the support ends at
# the rim, counted outward from the outermost seeds.
_CLOSING = 1.2
_RIM = 0.2
_EVEN = 1.0
_HALF = 0.5


def support_on_grid(
    points: NDArray[np.float32], spacing: float, step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Give the grid points over the seeds, with enclosed holes but nothing past the rim.

    Parameters
    ----------
    points : (n, 3) float32, mm
    spacing : mean spacing of the seeds, mm
    step : distance of grid points, mm

    Returns
    -------
    xs, ys : (columns,), (rows,) float64, mm
    support : (rows, columns) bool
    """
    reach = (_CLOSING + _EVEN) * spacing
    x, y = points[:, 0], points[:, 1]
    xs, ys = _axis(x, reach, step), _axis(y, reach, step)
    seeded = np.zeros((len(ys), len(xs)), np.uint8)
    seeded[_nearest(y, ys[0], step), _nearest(x, xs[0], step)] = 1
    closed = fill_holes(
        np.asarray(cv2.dilate(seeded, disc(_CLOSING * spacing / step)), np.uint8))
    # The sensor leaves an edge frayed: its outline is evened out, neither grown nor shrunk.
    even = cv2.GaussianBlur(closed.astype(np.float32), (0, 0), _EVEN * spacing / step,
                            borderType=cv2.BORDER_CONSTANT) > _HALF
    support = cv2.erode(even.astype(np.uint8), disc((_CLOSING - _RIM) * spacing / step))
    return xs, ys, support > 0


def _axis(values: NDArray[np.float32], reach: float, step: float) -> NDArray[np.float64]:
    low, high = float(values.min()) - reach, float(values.max()) + reach
    return low + step * np.arange(int(np.ceil((high - low) / step)) + 1, dtype=np.float64)


def _nearest(values: NDArray[np.float32], low: float, step: float) -> NDArray[np.intp]:
    places: NDArray[np.intp] = np.rint((values - low) / step).astype(np.intp)
    return places
