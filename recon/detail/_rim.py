"""Near the rim: broader averages, and depth for what a frayed edge has taken.

At a depth edge the sensor's matching window takes one side or the other, several pixels at once.
What is left of the face there was read at places further in, where it is nearer, and the error is
alike over several spacings: narrow averages take it for detail. Constants: docs/decisions/0018.
"""

import math
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.numerics.filters import blurred, downsampled

BROADER = 4.0
"""Radius of the broad average, in radii of the narrow one."""

_BROAD_ALONE = 3.0
"""Up to this distance from the rim the broad average stands alone, mean spacings."""
_BROAD_ENDS = 8.0
"""From this distance on it does not count, mean spacings."""
_COLOR_BEHIND = 0.5
"""Up to this distance a colour may be of what lies behind the face, mean spacings."""
_COLOR_OWN = 2.5
"""From this distance on a colour is the face's own, mean spacings."""

_ITERATIONS = 5
"""How often the broad average is taken of what it leaves."""
_RIM_ITERATIONS = 16
"""The same at the rim: fewer leave a slope that has seeds on one side alone."""
_RELAXATION = 1.5
"""Factor on what an iteration finds: all is found below 2, above 1 sooner."""
_RIM_ITERATIONS_END = 3.0
"""Distance from the rim at which its iterations have faded out, mean spacings."""
_FADING = 0.05
"""The average fades where the seeds within reach weigh less than this part of what is usual."""

_SHIFT = 0.6
"""Outward shift of the surface at the rim, mean spacings."""
_MAX_SLOPE = 1.5
"""Largest slope, dz over distance, that the shift is multiplied by."""
_COVERAGE_RADIUS = 3.0
"""Standard deviation of the Gaussian that tells how near the rim is, mean spacings."""
_COVERAGE_AT_RIM = 0.5
"""How much of that Gaussian is over the face on a straight rim: the shift is whole."""
_COVERAGE_INSIDE = 0.9
"""The same 1.28 standard deviations inside: the shift has ended."""


@dataclass(frozen=True, eq=False)
class Rim:
    """Where the rim is, place by place.

    coverage : (rows, columns) float32, 0-1, how much of a Gaussian around a place is over the face
    distance : (rows, columns) float32, from the outline inward, mean spacings; negative outside
    """

    coverage: Floats
    distance: Floats

    @classmethod
    def of(cls, support: Bools, step: float) -> Self:
        """Find the rim of a support, on a grid of half the points each way.

        support : (rows, columns) bool
        step : side of a pixel, mean spacings
        """
        distance = cv2.distanceTransform(support.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        distance = (distance - np.float32(0.5)) * np.float32(step)
        coverage = blurred(downsampled(support.astype(np.float32)), _COVERAGE_RADIUS / (2 * step))
        return cls(coverage, downsampled(distance))

    @property
    def broad_weight(self) -> Floats:
        """Weight of the broad average, 0-1."""
        return _smoothstep(self.distance, _BROAD_ALONE, _BROAD_ENDS)

    @property
    def color_weight(self) -> Floats:
        """How much of a colour seen there is the face's and not of what is behind it, 0-1."""
        weight = (self.distance - np.float32(_COLOR_BEHIND)) / np.float32(
            _COLOR_OWN - _COLOR_BEHIND)
        return np.asarray(np.clip(weight, 0, 1), np.float32)

    def fraying_correction(self, dz_dx: Floats, dz_dy: Floats, spacing: float) -> Floats:
        """Give what is to be added to the depths, mm: an outward shift times the slope.

        dz_dx, dz_dy : (rows, columns) float32; spacing : mean spacing of the seeds, mm
        """
        inward = [cv2.Sobel(self.coverage, cv2.CV_32F, right, 1 - right, ksize=3)
                  for right in (1, 0)]
        outward_slope = -(inward[0] * dz_dx + inward[1] * dz_dy)
        # cv2.magnitude rounds by where in memory its input lies.
        outward_slope /= np.maximum(
            np.sqrt(inward[0] * inward[0] + inward[1] * inward[1]), np.float32(1e-9))
        shift = np.clip((_COVERAGE_INSIDE - self.coverage)
                        * np.float32(1 / (_COVERAGE_INSIDE - _COVERAGE_AT_RIM)), 0, 1)
        shift *= np.float32(_SHIFT * spacing)
        return np.asarray(shift * np.clip(outward_slope, 0, _MAX_SLOPE), np.float32)


def iterated_average(
    seeds: Floats, values: Floats, radius: float, usual: float, rim: Rim, finer: int
) -> Floats:
    """Average what the seeds show, then what that leaves of them, and so on (Richardson iteration).

    seeds, values : (rows, columns) float32, how many seeds are in each cell of a grid, and the sums
        of what they show, mm
    radius : of the Gaussian (standard deviation), cells
    usual : seeds in a cell where none are missing
    rim : of a finer grid; finer : its pixels along the side of a cell

    Gives float32, mm, on the rim's grid.
    """
    # On so few cells two small matrix products blur sooner than a filter does.
    down, across = (_blur_matrix(side, radius) for side in seeds.shape)
    gain = np.float32(_RELAXATION) / (down @ seeds @ across + np.float32(_FADING * usual))
    total = np.zeros_like(seeds)
    inside = total
    for iteration in range(_RIM_ITERATIONS):
        if iteration == _ITERATIONS:
            inside = total.copy()
        more = down @ (values - seeds * total) @ across
        more *= gain
        total += more
    rows, columns = rim.distance.shape
    inside, total = (
        np.asarray(cv2.resize(one, None, fx=finer, fy=finer, interpolation=cv2.INTER_LINEAR),
                   np.float32)[:rows, :columns] for one in (inside, total))
    return inside + _smoothstep(rim.distance, 0, _RIM_ITERATIONS_END) * (total - inside)


def _blur_matrix(side: int, sigma: float) -> Floats:
    """The (side, side) matrix that blurs columns by a Gaussian, zero outside."""
    steps = np.arange(side)
    taps = np.exp(steps**2 / (-2 * sigma * sigma)) / (math.sqrt(2 * math.pi) * sigma)
    return taps.astype(np.float32)[np.abs(np.subtract.outer(steps, steps))]


def _smoothstep(values: Floats, one: float, none: float) -> Floats:
    """Fall from 1, up to `one`, to 0, from `none` on, by 3 t^2 - 2 t^3."""
    t = np.clip((np.float32(none) - values) / np.float32(none - one), 0, 1)
    return np.asarray(t * t * (3 - 2 * t), np.float32)
