"""Where the seeds support a surface: over them and the holes they enclose, not past their rim."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from recon._scatter_kernels import bounds, mark
from recon.local_means import blurred
from recon.masks import disc, fill_holes

__all__ = ["support_on_grid"]

# In units of the mean spacing. Gaps narrower than twice the closing are none; the support ends at
# the rim, counted outward from the outermost seeds.
_CLOSING = 1.2
_RIM = 0.2
# The sensor leaves an edge frayed, over several pixels at once: its outline is evened out by a
# Gaussian of this radius, where seeds are few by no more than the second: a share of the side of a
# square as large as they are. It grows into bays by no more than the third.
_EVEN = 4.0
_EVEN_PART = 0.1
_GROWTH = 1.0
# Pixels for that radius: more change nothing.
_EVEN_PX = 3


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
    reach = (_CLOSING + _GROWTH) * spacing
    left, right, top, bottom = bounds(points)
    xs, ys = (_axis(low - reach, high + reach, step)
              for low, high in ((left, right), (top, bottom)))
    seeded = mark(points, (xs[0], ys[0]), step, len(ys), len(xs))
    closed = fill_holes(
        np.asarray(cv2.dilate(seeded, disc(_CLOSING * spacing / step)), np.uint8))
    even = min(_EVEN * spacing / step, _EVEN_PART * math.sqrt(np.count_nonzero(closed)))
    # Of a Gaussian that far inside a straight edge, so much is inside.
    inside = 0.5 + 0.5 * math.erf((_CLOSING - _RIM) * spacing / step / (even * math.sqrt(2)))
    most = cv2.dilate(closed, disc(_GROWTH * spacing / step))
    return xs, ys, (most > 0) & (_broadly_blurred(closed, even) > inside)


def _broadly_blurred(image: NDArray[np.uint8], sigma: float) -> NDArray[np.float32]:
    """Blur by a broad Gaussian, on fewer pixels where they are enough."""
    every = max(1, int(sigma / _EVEN_PX))
    rows, columns = (-(-side // every) for side in image.shape)
    whole = cv2.copyMakeBorder(
        image.astype(np.float32), 0, rows * every - image.shape[0], 0,
        columns * every - image.shape[1], cv2.BORDER_CONSTANT, value=0)
    small = np.asarray(
        cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)
    broad = blurred(small, sigma / every)
    return np.asarray(cv2.resize(broad, whole.shape[::-1], interpolation=cv2.INTER_LINEAR),
                      np.float32)[:image.shape[0], :image.shape[1]]


def _axis(low: float, high: float, step: float) -> NDArray[np.float64]:
    """Points from the least value to behind the largest, an even number."""
    return low + step * np.arange(2 * (int((high - low) / step) // 2 + 1), dtype=np.float64)
