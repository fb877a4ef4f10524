"""Where the seeds support a surface: over them and the holes they enclose, not past their rim."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from recon._scatter_kernels import bounds, mark
from recon.masks import disc, fill_holes

__all__ = ["support_on_grid"]

# In units of the mean spacing. Gaps narrower than twice the closing are none; the support ends at
# the rim, counted outward from the outermost seeds.
_CLOSING = 1.2
_RIM = 0.2
_EVEN = 1.0
_HALF = 0.5
# A blur by more than the first, pixels, is made at half the size: what going there and back blurs
# by already, squared pixels, is a quarter and three quarters.
_WIDE = 2.5
_HALVING_VARIANCE = 1.0


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
    left, right, top, bottom = bounds(points)
    xs, ys = (_axis(low - reach, high + reach, step)
              for low, high in ((left, right), (top, bottom)))
    seeded = mark(points, (xs[0], ys[0]), step, len(ys), len(xs))
    closed = fill_holes(
        np.asarray(cv2.dilate(seeded, disc(_CLOSING * spacing / step)), np.uint8))
    # The sensor leaves an edge frayed: its outline is evened out, neither grown nor shrunk.
    even = (_blurred(closed, _EVEN * spacing / step) > _HALF).view(np.uint8)
    support = cv2.erode(even, disc((_CLOSING - _RIM) * spacing / step))
    return xs, ys, support.view(np.bool_)


def _blurred(image: NDArray[np.uint8], sigma: float) -> NDArray[np.float32]:
    """Blur by a Gaussian; a wide one at half the size, which tells as much."""
    whole = np.asarray(image, np.float32)
    if sigma < _WIDE:
        return np.asarray(cv2.GaussianBlur(
            whole, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)
    half = cv2.resize(whole, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    half = cv2.GaussianBlur(half, (0, 0), math.sqrt(sigma * sigma - _HALVING_VARIANCE) / 2,
                            borderType=cv2.BORDER_CONSTANT)
    return np.asarray(
        cv2.resize(half, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR), np.float32)


def _axis(low: float, high: float, step: float) -> NDArray[np.float64]:
    """Points from the least value to behind the largest, an even number."""
    return low + step * np.arange(2 * (int((high - low) / step) // 2 + 1), dtype=np.float64)
