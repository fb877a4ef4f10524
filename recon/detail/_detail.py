"""Stage 5, `best` preset: what a broad fit smooths away, given back where it is more than noise.

One smoothing for the whole face is a compromise: cheeks and forehead could bear more of it, lips
and eyelids less. So the fit is broad, and what it leaves of the seeds is averaged around each
place by a narrow Gaussian. Of this detail the local Wiener gain of Lee, 1980,
doi:10.1109/TPAMI.1980.4766994, keeps what stands above noise.
"""

import math

import numpy as np
from numpy.typing import NDArray

from denseface.recon.detail._detail_kernels import blend_toward, face_field, shares, slopes
from denseface.recon.detail._holes import fill_holes
from denseface.recon.detail._mirror_plane import find_plane
from denseface.recon.detail._rim import BROADER, Rim, iterated_average
from denseface.recon.detail._shading import shading_detail
from denseface.recon.detail._symmetry import symmetry_correction
from denseface.recon.intermediate import ColorSampler, SurfaceGrid
from denseface.recon.numerics.bilinear import add_resampled
from denseface.recon.numerics.filters import blurred, downsampled, upsampled
from denseface.recon.numerics.normalized_convolution import normalized_convolution
from denseface.recon.numerics.percentile import percentile
from denseface.recon.numerics.scatter import BILINEAR_VARIANCE, interpolate, splat
from denseface.recon.support import Support

__all__ = ["add_detail"]

Image = NDArray[np.float32]

# Below this share of the usual weight lies a hole, or the rim: a broad average is taken there.
_FULL = 0.4
# An average fades where the seeds within reach weigh less than this share of what is usual.
_FADING = 0.005
# Over what radius detail counts as local (standard deviation).
_WINDOW_MM = 11.0
# The smoothest part of a face shows what noise alone adds to the detail, away from the rim, where
# broad averages leave less of it.
_NOISE_PERCENTILE = 26
_AT_RIM = 0.5
# What lies within about so many spacings of the rim tells little of the noise, and of the other
# side.
_FADING_RIM = 1.5


def add_detail(
    heights: Image, supported: Support, points: NDArray[np.float32], spacing: float,
    radius: float, *, symmetry: bool = False, sampler: ColorSampler | None = None,
) -> SurfaceGrid:
    """Add to a broad fit what its seeds show besides.

    Parameters
    ----------
    heights : (rows, columns) float32, mm, a fit of `points` on the support's grid
    supported : where they support a surface
    points : (n, 3) float32, mm, depth camera frame
    spacing : mean spacing of the points, mm
    radius : of the average (standard deviation), mm
    symmetry : let each side of the face be helped by the other's mirror image
    sampler : tells points' colours, of whose shading more detail is taken; None: of depth alone
    """
    xs, ys, step, support = supported.xs, supported.ys, supported.step, supported.inside
    columns, rows = (((points[:, axis] - low) / step).astype(np.float32)
                     for axis, low in ((0, xs[0]), (1, ys[0])))
    grid = _SeedGrid(columns, rows, support.shape)
    rest = points[:, 2] - grid.at_seeds(heights)
    usual = np.float32((step / spacing) ** 2)
    weight, detail = (blurred(one, _blur_after_scatter(radius / step)) for one in grid.sums(rest))
    seeded, missing = shares(weight, detail, float(usual) * _FADING, float(usual) * _FULL)
    rim = Rim.of(support, step / spacing)
    # So broad an average needs no more than every fourth point.
    cells = grid.halved().halved()
    counts, sums = cells.sums(rest)
    broad = iterated_average(counts, sums, BROADER * radius / (4 * step), 16 * float(usual), rim, 2)
    blend_toward(detail, upsampled(broad, detail.shape), upsampled(rim.nearness, detail.shape),
                 missing)
    filled, hole = fill_holes(counts, sums, missing, rim, heights, detail, spacing)
    detail *= 1 - hole

    # How much of it is more than noise varies slowly: every second point is enough.
    some = np.s_[::2, ::2]
    shown = support[some].astype(np.float32)
    inner = np.clip(2 * blurred(shown, _FADING_RIM) - 1, 0, 1) * shown
    field = face_field(heights, detail, seeded, inner, spacing)
    gain, noise = _gain(
        field[..., 3], inner * (1 - hole[some]), rim.nearness < _AT_RIM, spacing)
    origin = float(xs[0]), float(ys[0])
    plane = find_plane(field, origin, spacing) if symmetry else None
    kept = gain * detail[some]
    between = [(np.arange(side) / 2).astype(np.float32) for side in detail.shape]
    share = np.zeros_like(detail)
    add_resampled(share, gain, *between)
    detail *= share
    more = np.zeros_like(shown)
    if plane is not None:
        more = symmetry_correction(field, kept, filled[some], hole[some], plane, noise,
                                   _WINDOW_MM, origin, spacing)
    if sampler is not None:
        surface = heights[some] + detail[some] + filled[some] + more
        across, down = np.empty_like(surface), np.empty_like(surface)
        slopes(surface, spacing, across, down)
        more += shading_detail(
            surface, shown * rim.within, (across, down), (xs[::2], ys[::2]), sampler)
    add_resampled(detail, more, *between)

    smaller = downsampled(heights)
    across, down = np.empty_like(smaller), np.empty_like(smaller)
    slopes(smaller, 2 * step, across, down)
    detail += upsampled(rim.fraying_correction((across, down), spacing), detail.shape)
    detail += filled
    values = np.empty((3, *detail.shape), np.float32)
    np.add(heights, detail, out=values[0])
    slopes(values[0], step, values[1], values[2])
    noise_mm = float((rest - grid.at_seeds(detail)).std())
    return SurfaceGrid(values, supported, noise_mm, detailed=True)


class _SeedGrid:
    """Seeds over an image.

    Parameters
    ----------
    columns, rows : (n,) float32, where they are, pixels, inside the image and off its last row
        and column
    shape : (rows, columns) of the image
    """

    def __init__(self, columns: Image, rows: Image, shape: tuple[int, ...]) -> None:
        self.columns, self.rows, self.shape = columns, rows, shape

    def halved(self) -> "_SeedGrid":
        """The same over an image of which each pixel is four of these."""
        half = np.float32(0.5)
        columns, rows = (half * (one - half) for one in (self.columns, self.rows))
        return _SeedGrid(columns, rows, ((self.shape[0] + 1) // 2, (self.shape[1] + 1) // 2))

    def sums(self, values: Image) -> tuple[Image, Image]:
        """Sum the seeds, and their values, each shared among the four pixels around it."""
        counts, sums = np.zeros(self.shape, np.float32), np.zeros(self.shape, np.float32)
        splat(self.columns, self.rows, values, counts, sums)
        return counts, sums

    def at_seeds(self, image: Image) -> Image:
        """Interpolate an image, (n,)."""
        return interpolate(image, self.columns, self.rows)


def _blur_after_scatter(sigma: float) -> float:
    """The radius of a blur, less what sharing a value among four pixels has blurred already."""
    return math.sqrt(sigma * sigma - BILINEAR_VARIANCE)


def _gain(
    detail: Image, inner: Image, narrow: NDArray[np.bool_], step: float
) -> tuple[Image, float]:
    """How much of the detail is not noise, 0-1, place by place, and the variance of noise.

    detail : mm along the normal: along z, noise and detail both grow where a face is steep
    inner : 0-1, what counts as face
    narrow : where the detail is of narrow averages; where it is so nowhere, all of it tells
    """
    local, = normalized_convolution(inner, _WINDOW_MM / (2 * step), detail * detail)
    local = upsampled(local, detail.shape)
    seen = local[(inner > 0) & narrow] if narrow.any() else local[inner > 0]
    noise = percentile(seen, _NOISE_PERCENTILE) if seen.size else 0.0
    gain = 1 - np.float32(noise) / np.maximum(local, np.float32(max(noise, 1e-12)))
    return np.asarray(gain, np.float32), noise
