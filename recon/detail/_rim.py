"""Near the rim: broader averages, and depth for what a frayed edge has taken.

At a depth edge the sensor's matching window takes one side or the other, several pixels at once.
What is left of the face there was read at places further in, where it is nearer, and the error is
alike over several spacings: narrow averages take it for detail.
"""

import math
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.filters import blurred, downsampled

__all__ = ["BROADER", "Rim", "iterated_average"]

Image = NDArray[np.float32]

BROADER = 4.0
"""Radius of the broad average, in radii of the narrow one."""

# In units of the mean spacing: up to the first the broad average stands alone, from the second on
# it does not count.
_ALONE, _NONE = 3.0, 8.0
# A colour up to the first may be of what lies behind, from the second on it is the face's own.
_BEHIND, _OWN = 0.5, 2.5
# How often it is taken of what it leaves, and how often within so much of the rim, where fewer
# would leave a slope that has seeds on one side alone. Each adds what it finds times a factor:
# below 2, all is found in the end, above 1 sooner.
_PASSES, _PASSES_AT_RIM = 5, 16
_RELAXATION = 1.5
_AT_RIM = 3.0
# It fades where the seeds within reach weigh less than this share of what is usual.
_FADING = 0.05
# The sideways shift at the rim, in mean spacings; the slope that counts, at most; over what radius
# (standard deviation) it is told how near the rim is: there half of a Gaussian is over the face.
# Where so much is, 1.28 radii inside, the shift has ended.
_SHIFT = 0.6
_STEEPEST = 1.5
_AROUND = 3.0
_HALF, _INSIDE = 0.5, 0.9


@dataclass(frozen=True, eq=False)
class Rim:
    """Where the rim is, place by place.

    Attributes
    ----------
    inside : (rows, columns) float32, 0-1, how much of a Gaussian around a place is over the face
    away : (rows, columns) float32, how far inside the outline, mean spacings; less than 0 outside
    """

    inside: Image
    away: Image

    @classmethod
    def of(cls, support: NDArray[np.bool_], step: float) -> Self:
        """Find the rim of a support, on a grid of half the points each way.

        support : (rows, columns) bool
        step : side of a pixel, mean spacings
        """
        away = cv2.distanceTransform(support.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        away = (away - np.float32(0.5)) * np.float32(step)
        return cls(blurred(downsampled(support.astype(np.float32)), _AROUND / (2 * step)),
                   downsampled(away))

    @property
    def nearness(self) -> Image:
        """How much the broad average counts, 0-1."""
        return _smoothstep(self.away, _ALONE, _NONE)

    @property
    def within(self) -> Image:
        """How much what is seen there is of the face and not of what is behind it, 0-1."""
        share = (self.away - np.float32(_BEHIND)) / np.float32(_OWN - _BEHIND)
        return np.asarray(np.clip(share, 0, 1), np.float32)

    def fraying_correction(self, slopes: tuple[Image, Image], spacing: float) -> Image:
        """Give what is to be added to the depths: a shift toward the rim, times the slope.

        Parameters
        ----------
        slopes : dz/dx, dz/dy, (rows, columns) float32
        spacing : mean spacing of the seeds, mm

        Returns
        -------
        (rows, columns) float32, mm
        """
        inward = [cv2.Sobel(self.inside, cv2.CV_32F, right, 1 - right, ksize=3)
                  for right in (1, 0)]
        outward_slope = -(inward[0] * slopes[0] + inward[1] * slopes[1])
        # cv2.magnitude rounds by where in memory its input lies.
        outward_slope /= np.maximum(
            np.sqrt(inward[0] * inward[0] + inward[1] * inward[1]), np.float32(1e-9))
        shift = np.clip((_INSIDE - self.inside) * np.float32(1 / (_INSIDE - _HALF)), 0, 1)
        shift *= np.float32(_SHIFT * spacing)
        return np.asarray(shift * np.clip(outward_slope, 0, _STEEPEST), np.float32)


def iterated_average(
    seeds: Image, values: Image, radius: float, usual: float, rim: Rim, finer: int
) -> Image:
    """Average what the seeds show, then what that leaves of them, and so on.

    Parameters
    ----------
    seeds : (rows, columns) float32, how many are in each cell of a grid
    values : the sums of what they show, mm
    radius : of the Gaussian (standard deviation), cells
    usual : seeds in a cell where none are missing
    rim : of a finer grid
    finer : its pixels along the side of a cell

    Returns
    -------
    float32, mm, on the rim's grid
    """
    # On so few cells two small matrix products blur sooner than a filter does.
    down, across = (_blur_matrix(side, radius) for side in seeds.shape)
    gain = np.float32(_RELAXATION) / (down @ seeds @ across + np.float32(_FADING * usual))
    total = np.zeros_like(seeds)
    inside = total
    for number in range(_PASSES_AT_RIM):
        if number == _PASSES:
            inside = total.copy()
        more = down @ (values - seeds * total) @ across
        more *= gain
        total += more
    rows, columns = rim.away.shape
    inside, total = (
        np.asarray(cv2.resize(one, None, fx=finer, fy=finer, interpolation=cv2.INTER_LINEAR),
                   np.float32)[:rows, :columns] for one in (inside, total))
    return inside + _smoothstep(rim.away, 0, _AT_RIM) * (total - inside)


def _blur_matrix(side: int, sigma: float) -> Image:
    """What filters an image of so many rows from the left by a Gaussian, zero outside."""
    steps = np.arange(side)
    taps = np.exp(steps**2 / (-2 * sigma * sigma)) / (math.sqrt(2 * math.pi) * sigma)
    return taps.astype(np.float32)[np.abs(np.subtract.outer(steps, steps))]


def _smoothstep(values: Image, one: float, none: float) -> Image:
    """1 up to a value, 0 from another on, smooth between (3 t^2 - 2 t^3)."""
    t = np.clip((np.float32(none) - values) / np.float32(none - one), 0, 1)
    return np.asarray(t * t * (3 - 2 * t), np.float32)
