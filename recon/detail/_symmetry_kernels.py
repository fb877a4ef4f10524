"""Local moments of a face and its mirror image, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["add_mirrored", "halved_moments", "halved_peaks", "parts_kept"]

Image = NDArray[np.float32]

_LEAST_SHARE = np.float32(1e-6)


@compiled
def halved_moments(field: Image, image: Image, hole: Image) -> tuple[Image, Image, Image]:
    """Give what `symmetry_correction` averages, first and last as sums over each four pixels.

    field : (rows, columns, 5) and image : (5, rows, columns), as there; hole : (rows, columns)

    Gives the weight of what both sides measured, and times that d^2 + d'^2 and d d', half of the
    rows and columns, rounded up, and 3; the same weight, and times that d - d', (rows, columns, 2);
    the weight of what this side measured, and times that the squared gap, of half the size, and 2.
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
            own, other, gap = field[i, j, 3], image[3, i, j], image[0, i, j]
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
def halved_peaks(differences: Image, blurred: Image, scale: float) -> Image:
    """Give the largest square of a mean difference among each four pixels, times a factor.

    differences : (rows, columns, 2), weight, and times that the difference, as of `halved_moments`;
        blurred : the same; only where the weight is not zero a difference counts
    """
    rows, columns = differences.shape[:2]
    out = np.zeros(((rows + 1) // 2, (columns + 1) // 2), np.float32)
    factor = np.float32(scale)
    for i in range(rows):
        for j in range(columns):
            if differences[i, j, 0] > 0:
                mean = blurred[i, j, 1] / max(blurred[i, j, 0], _LEAST_SHARE)
                out[i >> 1, j >> 1] = max(out[i >> 1, j >> 1], factor * mean * mean)
    return out


@compiled
def parts_kept(moments: Image, same: Image, noise: float) -> Image:
    """Give the parts of either side's detail that are kept, (rows, columns, 3).

    moments : as of `halved_moments`, blurred
    same : (rows, columns), 0-1, how far the sides are alike
    noise : variance

    Of d, of d', and how far the sides are alike.
    """
    rows, columns = same.shape
    out = np.empty((rows, columns, 3), np.float32)
    v, half = np.float32(noise), np.float32(0.5)
    for i in range(rows):
        for j in range(columns):
            share = np.float32(1) / max(moments[i, j, 0], _LEAST_SHARE)
            signal = max(half * share * moments[i, j, 1] - v, np.float32(0))
            common = min(max(share * moments[i, j, 2], -signal), signal)
            # (P + v)^2 - C^2 and P (P + v) - C^2, so that nothing cancels where C = P.
            alone = signal - common
            scale = same[i, j] / ((alone + v) * (signal + common + v))
            out[i, j, 0] = scale * (alone * (signal + common) + signal * v)
            out[i, j, 1] = scale * (common * v)
            out[i, j, 2] = same[i, j]
    return out


@compiled
def add_mirrored(
    field: Image, image: Image, kept: Image, hole: Image, parts: Image, differs: Image,
    broad: float, least: float,
) -> Image:
    """Give what the mirror image adds, (rows, columns), mm along z: see `symmetry_correction`.

    parts : (rows, columns, 3), as of `parts_kept`; differs : (rows, columns), mm^2, how far the
        broad fits of both sides are apart
    broad : variance of the broad fit between seeds; least : no place has less of them
    """
    rows, columns = hole.shape
    out = np.zeros((rows, columns), np.float32)
    v, fewest = np.float32(broad), np.float32(least)
    for i in range(rows):
        for j in range(columns):
            if image[2, i, j] == 0:
                continue
            facing, gap, filled = field[i, j, 1], image[0, i, j], hole[i, j]
            # What Lee's gain keeps is there already.
            found = (parts[i, j, 0] * field[i, j, 3] + parts[i, j, 1] * image[3, i, j]
                     - parts[i, j, 2] * kept[i, j] * facing) * (1 - filled)
            here, there = v / max(field[i, j, 4], fewest), v / max(image[4, i, j], fewest)
            gap += filled * (image[1, i, j] - gap)
            found += here / max(here + there, differs[i, j]) * gap
            out[i, j] = image[2, i, j] * found / facing
    return out
