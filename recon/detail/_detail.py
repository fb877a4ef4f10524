"""Stage 5, `best` preset: what a broad fit smooths away, given back where it is more than noise.

One smoothing for the whole face is a compromise: cheeks and forehead could bear more of it, lips
and eyelids less. So the fit is broad, and what it leaves of the seeds is averaged around each
place by a narrow Gaussian. Of this detail the local Wiener gain of Lee, 1980,
doi:10.1109/TPAMI.1980.4766994, keeps what stands above noise. Constants: docs/decisions/0008, 0017.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.detail import _detail_kernels as kernels
from denseface.recon.detail._holes import fill_holes
from denseface.recon.detail._mirror_kernels import HeightField
from denseface.recon.detail._mirror_plane import find_plane
from denseface.recon.detail._rim import BROADER, Rim, iterated_average
from denseface.recon.detail._shading import shading_detail
from denseface.recon.detail._symmetry import symmetry_correction
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.noise import Risk
from denseface.recon.numerics.bilinear import add_resampled, multiply_resampled
from denseface.recon.numerics.filters import blurred, downsampled, upsampled
from denseface.recon.numerics.morphology import select_values
from denseface.recon.numerics.normalized_convolution import normalized_convolution
from denseface.recon.numerics.percentile import percentile
from denseface.recon.numerics.scatter import BILINEAR_VARIANCE, interpolate, splat
from denseface.recon.support import Support

_FULL = 0.4
"""Below this part of the usual weight of seeds lies a hole, or the rim."""
_FADING = 0.005
"""Averages fade where the seeds within reach weigh less than this part of what is usual."""
_WINDOW_MM = 11.0
"""Standard deviation of the Gaussian over which detail counts as local, mm."""
_NOISE_PERCENTILE = 26
"""The smoothest part of a face shows what noise alone adds to the detail, percent."""
_NARROW = 0.5
"""Noise is told where the broad average weighs less: it leaves less noise."""
_RIM_SPACINGS = 1.5
"""So near the rim detail tells little of the noise, and of the other side, mean spacings."""
_MOST_FIT_SHARE = 0.25
"""Variance of the broad fit's noise over that of the detail's: with more, what one side has alone
fades."""

_COARSE = np.s_[::2, ::2]
"""Every second point each way: how much of the detail is noise varies slowly."""


def add_detail(
    heights: Floats, support: Support, points: Floats, spacing: float, radius: float, plan: Risk, *,
    symmetry: bool = False, sampler: ColorSampler | None = None,
) -> SurfaceGrid:
    """Add to a broad fit what its seeds show besides.

    Parameters
    ----------
    heights : (rows, columns) float32, mm, a fit of `points` on the support's grid
    support : where they support a surface
    points : (n, 3) float32, mm, depth camera frame
    spacing : mean spacing of the points, mm
    radius : of the average (standard deviation), mm
    plan : the fit's expected error, and the noise in it and in the averages
    symmetry : correct each side of the face by the other's mirror image
    sampler : tells points' colours, of whose shading more detail is taken; None: of depth alone
    """
    inside = support.inside
    seeds = _SeedGrid.over(points, support)
    residuals = points[:, 2] - interpolate(heights, seeds.columns, seeds.rows)
    rim = Rim.of(inside, support.step / spacing)
    averages = _average(seeds, residuals, heights, rim, radius / support.step, spacing,
                        support.step)
    detail, filled, hole = averages.detail, averages.filled, averages.hole

    shown = inside[_COARSE].astype(np.float32)
    inner = np.clip(2 * blurred(shown, _RIM_SPACINGS) - 1, 0, 1) * shown
    field = HeightField(kernels.mirror_planes(heights, detail, averages.seeded, inner, spacing),
                        np.array([support.xs[0], support.ys[0], 0.0]), spacing)
    gain, noise = _wiener_gain(
        field.planes[..., 3], inner * (1 - hole[_COARSE]), rim.broad_weight < _NARROW, spacing)
    kept = gain * detail[_COARSE]
    multiply_resampled(detail, gain, *_halves(detail.shape))
    more = np.zeros_like(shown)
    plane = find_plane(field) if symmetry else None
    if plane is not None:
        more = symmetry_correction(
            field, kept, filled[_COARSE], hole[_COARSE], plane, noise,
            min(plan.fit_noise / max(plan.detail_noise, 1e-12), _MOST_FIT_SHARE), _WINDOW_MM)
    if sampler is not None:
        surface = heights[_COARSE] + detail[_COARSE] + filled[_COARSE] + more
        more += shading_detail(
            surface, shown * rim.color_weight, kernels.with_slopes(surface, spacing)[1:],
            (support.xs[::2], support.ys[::2]), sampler, plan)
    _add_upsampled(detail, more)
    _, dz_dx, dz_dy = kernels.with_slopes(downsampled(heights), 2 * support.step)
    detail += upsampled(rim.fraying_correction(dz_dx, dz_dy, spacing), detail.shape)
    detail += filled
    return SurfaceGrid(kernels.with_slopes(heights + detail, support.step), support, detailed=True)


class _SeedGrid(NamedTuple):
    """Seeds over an image.

    columns, rows : (n,) float32, pixels, inside the image and off its last row and column
    shape : (rows, columns) of the image
    """

    columns: Floats
    rows: Floats
    shape: tuple[int, ...]

    @classmethod
    def over(cls, points: Floats, support: Support) -> Self:
        """Place (n, 3) points, mm, on the grid of their support."""
        columns, rows = (((points[:, axis] - low) / support.step).astype(np.float32)
                         for axis, low in ((0, support.xs[0]), (1, support.ys[0])))
        return cls(columns, rows, support.margin.shape)

    def halved(self) -> Self:
        """The same over an image of which each pixel is four of these."""
        half = np.float32(0.5)
        columns, rows = (half * (one - half) for one in (self.columns, self.rows))
        return type(self)(columns, rows, ((self.shape[0] + 1) // 2, (self.shape[1] + 1) // 2))

    def scatter(self, values: Floats) -> tuple[Floats, Floats]:
        """Sum the seeds, and their values, by bilinear weights on the four pixels around each."""
        counts, sums = np.zeros(self.shape, np.float32), np.zeros(self.shape, np.float32)
        splat(self.columns, self.rows, values, counts, sums)
        return counts, sums


class _Averages(NamedTuple):
    """Local averages of the residuals, (rows, columns) float32 each.

    detail : mm along z, narrow averages, broad ones at the rim; 0 where a hole is filled
    seeded : 0-1, weight of the seeds
    filled : mm along z, in holes, weighted by
    hole : 0-1
    """

    detail: Floats
    seeded: Floats
    filled: Floats
    hole: Floats


def _average(
    seeds: _SeedGrid, residuals: Floats, heights: Floats, rim: Rim, radius: float, spacing: float,
    step: float,
) -> _Averages:
    """Average the residuals, and fill holes.

    radius : of the narrow average (standard deviation), points of the grid
    step : distance of these, mm
    """
    usual = float(np.float32((step / spacing) ** 2))
    blur = _blur_after_scatter(radius)
    weight, detail = (blurred(one, blur) for one in seeds.scatter(residuals))
    seeded, missing = kernels.normalize_sums(weight, detail, usual * _FADING, usual * _FULL)
    # So broad an average needs no more than every fourth point.
    counts, sums = seeds.halved().halved().scatter(residuals)
    broad = iterated_average(counts, sums, BROADER * radius / 4, 16 * usual, rim, 2)
    kernels.blend_toward(detail, upsampled(broad, detail.shape),
                         upsampled(rim.broad_weight, detail.shape), missing)
    filled, hole = fill_holes(counts, sums, missing, rim, heights, detail, spacing)
    detail *= 1 - hole
    return _Averages(detail, seeded, filled, hole)


def _blur_after_scatter(sigma: float) -> float:
    """Give the standard deviation of a blur, less what bilinear weights have blurred already."""
    return math.sqrt(sigma * sigma - BILINEAR_VARIANCE)


def _wiener_gain(detail: Floats, inner: Floats, narrow: Bools, step: float) -> tuple[Floats, float]:
    """Give the gain, 0-1, place by place, and the variance of noise, mm^2.

    detail : mm along the normal: along z, noise and detail both grow where a face is steep
    inner : 0-1, what counts as face
    narrow : where the detail is of narrow averages; where it is so nowhere, all of it tells
    """
    local, = normalized_convolution(inner, _WINDOW_MM / (2 * step), detail * detail)
    local = upsampled(local, detail.shape)
    face = inner > 0
    seen = select_values(local, face & narrow if narrow.any() else face)
    noise = percentile(seen, _NOISE_PERCENTILE) if seen.size else 0.0
    gain = 1 - np.float32(noise) / np.maximum(local, np.float32(max(noise, 1e-12)))
    return np.asarray(gain, np.float32), noise


def _add_upsampled(image: Floats, coarse: Floats) -> Floats:
    """Add in place what is known at every second point each way, bilinear; give the image."""
    add_resampled(image, coarse, *_halves(image.shape))
    return image


def _halves(shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Give where rows and columns are on a grid of every second of them."""
    rows, columns = ((np.arange(side) / 2).astype(np.float32) for side in shape)
    return rows, columns
