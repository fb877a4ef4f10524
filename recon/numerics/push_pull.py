"""Colours of an image interpolated from the known ones around, by push-pull.

Push: sums of colours are filtered and halved until every wanted pixel has neighbours. Pull: what
was missing is interpolated from the next coarser level. Each level is a normalized convolution
(Knutsson and Westin, 1993, doi:10.1109/CVPR.1993.341081); push-pull is of Gortler, Grzeszczuk,
Szeliski and Cohen, 1996, doi:10.1145/237170.237200.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Floats
from denseface.recon.numerics._push_pull_kernels import (
    divide,
    halve,
    masked_sums,
    pull,
    set_rounded,
    splat_colors,
)
from denseface.recon.numerics.filters import filtered, gaussian_taps

__all__ = ["inpaint_colors", "interpolate_colors"]

_LEAST_COUNT = 0.05
"""Filtered count, in units of that of dense colours, below which a mean is taken from farther."""
_COARSEST = 4
"""Largest side of a level that is not halved again, pixels."""
_REACH = np.ones((5, 5), np.uint8)
"""Coarse pixels that are wanted around a missing one, to interpolate between."""


def interpolate_colors(
    colors: Bytes, coordinates: NDArray[np.number], wanted: Bools, radius: float, spacing: float
) -> Bytes:
    """Average scattered colours over an image by a Gaussian of growing radius.

    Parameters
    ----------
    colors : (n, 3) uint8, RGB, n >= 1
    coordinates : (n, 2) int or float, (row, column) of each, inside the image
    wanted : (rows, columns) bool, the pixels of the image that need a colour
    radius : standard deviation where colours are dense, pixels; doubled as long as none is near
    spacing : usual distance of neighbouring colours, pixels

    Returns
    -------
    (rows, columns, 3) uint8, RGB; zero where not `wanted`

    Raises
    ------
    ValueError
        Where there is no colour to average.
    """
    if not len(colors):
        raise ValueError("colors must not be empty")
    sums = splat_colors(colors, np.ascontiguousarray(coordinates, np.float32), *wanted.shape)
    image = np.zeros((*wanted.shape, 3), np.uint8)
    _push_pull(sums, wanted, gaussian_taps(radius), _LEAST_COUNT / spacing**2, image)
    return image


def inpaint_colors(image: Bytes, known: Bools, missing: Bools) -> None:
    """Fill an image's missing colours with the mean of the known ones around them.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB; changed where `missing`
    known, missing : (rows, columns) bool; at least one is known
    """
    _push_pull(masked_sums(image, known), missing, gaussian_taps(1.0), _LEAST_COUNT, image)


def _push_pull(sums: Floats, wanted: Bools, taps: Floats, least: float, image: Bytes) -> None:
    """Set the wanted pixels of an image; sums : (rows, columns, 4), or more."""
    levels = []
    asked = wanted
    while True:
        counted = filtered(sums, taps)
        coarsest = max(asked.shape) <= _COARSEST
        mean, missing, count = divide(counted, asked, 0.0 if coarsest else least)
        levels.append((mean, missing))
        if count == 0 or coarsest:
            break
        sums, below = halve(counted, missing)
        asked = np.asarray(cv2.dilate(below.view(np.uint8), _REACH)).view(np.bool_)
    for (mean, missing), (coarse, _) in zip(levels[-2::-1], levels[:0:-1], strict=True):
        pull(mean, missing, coarse)
    set_rounded(levels[0][0], wanted, image)
