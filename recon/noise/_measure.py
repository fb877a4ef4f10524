"""How noisy depth is, from the seeds of one frame.

Second and third differences over a lag of some pixels take out a plane and a paraboloid, and leave
noise and the face's own detail: generalized increments (Matheron, 1973, doi:10.2307/1425829), and
their mean squares over the lags are a variogram without a trend. What a face adds to it was
learned from heads (docs/method.md); the rest is explained by white noise and noise that is alike
over some pixels.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from denseface.recon.arrays import Bytes, Floats, Ints
from denseface.recon.noise import _kernels as kernels
from denseface.recon.numerics.percentile import percentile

_SLOPE_BLUR_PX = 3.0
"""Standard deviation of the Gaussian before slopes are taken, pixels."""
_MOST_SQUARED_SLOPE = 0.5
"""Where a face is steeper its own relief hides the noise."""
_SAMPLES = 5000
"""About so many places, along each direction, are enough."""
_LEVELS_OF = 3000
"""About so many seeds tell the levels of depth."""
_NO_LEVELS_MM = 1e-6
"""Levels nearer than this are none."""
_MIDDLE = (10, 90)
"""Percentiles of the depths between which the levels are counted."""


@dataclass(frozen=True)
class Noise:
    """What differs from the true depth, along z, where a face is not steep.

    Attributes
    ----------
    white_mm : standard deviation of what differs from pixel to pixel, rounding included
    smooth_mm : standard deviation of what is alike over some pixels
    length_px : standard deviation of the Gaussian that blurs white noise to be alike so
    quantum_mm : distance of neighbouring levels of depth
    """

    white_mm: float
    smooth_mm: float
    length_px: float
    quantum_mm: float

    @property
    def total_mm(self) -> float:
        """Standard deviation of both, mm."""
        return math.hypot(self.white_mm, self.smooth_mm)

    @property
    def level_error_mm(self) -> float:
        """What no average takes away of the rounding to levels, standard deviation, mm.

        Noise of s before the rounding leaves q / pi exp(-2 pi^2 s^2 / q^2) of its first harmonic
        (Widrow and Kollar, 2008, doi:10.1017/CBO9780511754661, ch. 19).
        """
        q = self.quantum_mm
        if q < _NO_LEVELS_MM:
            return 0.0
        before = max(self.total_mm**2 - q * q / 12, 0.0)
        return q / (math.sqrt(2) * math.pi) * math.exp(-2 * math.pi**2 * before / (q * q))

    def averaged(self, side: int) -> "Noise":
        """Give what is left of it in the means of squares of `side` pixels each way.

        A mean over k pixels is nearly a Gaussian of variance (k^2 - 1) / 12 along each axis. What
        is smooth keeps its density in long waves, which its variance times its length squared is.
        """
        blur = (side * side - 1) / 12
        length = math.sqrt(self.length_px**2 + blur)
        return Noise(self.white_mm / side, self.smooth_mm * self.length_px / length, length / side,
                     self.quantum_mm)

    @property
    def correlation_px(self) -> float:
        """The length, as far as noise is alike over it: 0 of white noise, pixels."""
        return self.length_px * self.smooth_mm / max(self.total_mm, 1e-9)


def measure_noise(points: Floats, pixels: Ints, spacing: float) -> Noise:
    """Measure the noise of a face's seeds.

    Parameters
    ----------
    points : (n, 3) float32, mm, depth camera frame
    pixels : (n, 2) int32, (row, column) of each in the depth image
    spacing : their mean spacing, mm
    """
    heights = kernels.lattice(points, pixels)
    every = max(1, len(points) // _SAMPLES)
    squares = kernels.mean_square_differences(heights, gentle_places(heights, spacing), every)
    white, smooth, length = kernels.explain(squares, spacing)
    quantum = _quantum(points[:, 2])
    # Rounding alone makes that much; differences of few levels may hide it.
    white = max(white, quantum**2 / 12 - smooth)
    return Noise(math.sqrt(white), math.sqrt(smooth), length, quantum)


def gentle_places(heights: Floats, spacing: float) -> Bytes:
    """Say where a surface is not steep: (rows, columns) uint8, 0 or 1; heights 0 where none is."""
    measured = (heights > 0).astype(np.float32)
    middle = np.float32(heights.sum(dtype=np.float64) / max(float(measured.sum()), 1.0))
    weight = cv2.GaussianBlur(measured, (0, 0), _SLOPE_BLUR_PX)
    smooth = cv2.GaussianBlur(heights - middle * measured, (0, 0), _SLOPE_BLUR_PX)
    smooth = smooth / np.maximum(weight, np.float32(1e-3))
    by_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=1, scale=0.5 / spacing)
    by_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=1, scale=0.5 / spacing)
    return (by_x * by_x + by_y * by_y < np.float32(_MOST_SQUARED_SLOPE)).view(np.uint8)


def _quantum(z: Floats) -> float:
    """Give the mean distance of the levels that depths have, mm."""
    levels = np.unique(z[::max(1, len(z) // _LEVELS_OF)])
    low, high = (percentile(z, percent) for percent in _MIDDLE)
    inner = levels[(levels >= low) & (levels <= high)]
    if len(inner) < 2:
        inner = levels
    return float((inner[-1] - inner[0]) / (len(inner) - 1)) if len(inner) > 1 else 0.0
