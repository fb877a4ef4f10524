"""Local moments of a face and its mirror image, compiled."""

import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.numerics.jit import compiled

_MIN_WEIGHT = np.float32(1e-6)
"""Weights below it are taken for it, so that nothing is divided by zero."""
_MIN_SEEDS = np.float32(0.2)
"""Least weight of the seeds, 0-1: the mirror image fills holes even where the sides differ."""


@compiled
def mirror_moments(planes: Floats, image: Floats, hole: Floats) -> tuple[Floats, Floats, Floats]:
    """Give the weighted products that `symmetry_correction` averages, zero where nothing is.

    planes : (rows, columns, 5), of the field; image : (5, rows, columns), of `mirror_image`
    hole : (rows, columns), 0-1

    Returns
    -------
    moments : (rows / 2, columns / 2, 3), rounded up, sums over four pixels: the weight w of what
        both sides measured, w (d^2 + d'^2), w d d'
    differences : (rows, columns, 2): w, w (d - d')
    gaps : (rows / 2, columns / 2, 2): the weight of what this side measured, times the gap squared
    """
    rows, columns = hole.shape
    half = (rows + 1) // 2, (columns + 1) // 2
    moments = np.zeros((*half, 3), np.float32)
    differences, gaps = np.zeros((rows, columns, 2), np.float32), np.zeros((*half, 2), np.float32)
    for i in range(rows):
        for j in range(columns):
            measured = image[2, i, j] * (1 - hole[i, j])
            if measured == 0:
                continue
            both = measured * image[4, i, j]
            own, other, gap = planes[i, j, 3], image[3, i, j], image[0, i, j]
            row, column = i >> 1, j >> 1
            moments[row, column, 0] += both
            moments[row, column, 1] += both * (own * own + other * other)
            moments[row, column, 2] += both * (own * other)
            differences[i, j, 0] = both
            differences[i, j, 1] = both * (own - other)
            gaps[row, column, 0] += measured
            gaps[row, column, 1] += measured * (gap * gap)
    return moments, differences, gaps


@compiled
def peak_differences(differences: Floats, blurred: Floats, scale: float) -> Floats:
    """Give the largest squared mean difference of each four pixels, times a factor.

    differences : (rows, columns, 2), of `mirror_moments`: pixels without weight do not count
    blurred : the same, blurred
    """
    rows, columns = differences.shape[:2]
    out = np.zeros(((rows + 1) // 2, (columns + 1) // 2), np.float32)
    factor = np.float32(scale)
    for i in range(rows):
        for j in range(columns):
            if differences[i, j, 0] > 0:
                mean = blurred[i, j, 1] / max(blurred[i, j, 0], _MIN_WEIGHT)
                out[i >> 1, j >> 1] = max(out[i >> 1, j >> 1], factor * mean * mean)
    return out


@compiled
def shrinkage_factors(moments: Floats, alike: Floats, noise: float) -> Floats:
    """Give c1, c2 of `symmetry_correction` times `alike`, and `alike`: (rows, columns, 3).

    moments : (rows, columns, 3), of `mirror_moments`, blurred
    alike : (rows, columns), 0-1, how far the sides are alike
    noise : variance v, mm^2
    """
    rows, columns = alike.shape
    out = np.empty((rows, columns, 3), np.float32)
    v, half = np.float32(noise), np.float32(0.5)
    for i in range(rows):
        for j in range(columns):
            inverse = np.float32(1) / max(moments[i, j, 0], _MIN_WEIGHT)
            signal = max(half * inverse * moments[i, j, 1] - v, np.float32(0))
            common = min(max(inverse * moments[i, j, 2], -signal), signal)
            # (P + v)^2 - C^2 and P (P + v) - C^2, so that nothing cancels where C = P.
            alone = signal - common
            scale = alike[i, j] / ((alone + v) * (signal + common + v))
            out[i, j, 0] = scale * (alone * (signal + common) + signal * v)
            out[i, j, 1] = scale * (common * v)
            out[i, j, 2] = alike[i, j]
    return out


@compiled
def correction(
    planes: Floats, image: Floats, kept: Floats, hole: Floats, factors: Floats, gap_energy: Floats,
    fit_variance: float,
) -> Floats:
    """Give what the mirror image adds, (rows, columns), mm along z: see `symmetry_correction`.

    factors : (rows, columns, 3), of `shrinkage_factors`
    gap_energy : (rows, columns), mm^2, mean squared gap of both sides' broad fits
    fit_variance : of the broad fit where no seeds are missing, mm^2
    """
    rows, columns = hole.shape
    out = np.zeros((rows, columns), np.float32)
    v = np.float32(fit_variance)
    for i in range(rows):
        for j in range(columns):
            if image[2, i, j] == 0:
                continue
            facing, gap, filled = planes[i, j, 1], image[0, i, j], hole[i, j]
            # What the Wiener gain keeps is in the surface already.
            found = (factors[i, j, 0] * planes[i, j, 3] + factors[i, j, 1] * image[3, i, j]
                     - factors[i, j, 2] * kept[i, j] * facing) * (1 - filled)
            here, there = v / max(planes[i, j, 4], _MIN_SEEDS), v / max(image[4, i, j], _MIN_SEEDS)
            gap += filled * (image[1, i, j] - gap)
            found += here / max(here + there, gap_energy[i, j]) * gap
            out[i, j] = image[2, i, j] * found / facing
    return out
