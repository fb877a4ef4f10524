"""Colours as the mean of their neighbours: near ones where there are any, else farther ones."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics._push_pull_kernels import average, planes, scatter
from denseface.recon.numerics.filters import gaussian_taps

__all__ = ["inpaint_colors", "interpolate_colors"]

_LEAST_WEIGHT = 0.05


def interpolate_colors(
    colors: NDArray[np.uint8],
    places: NDArray[np.number],
    wanted: NDArray[np.bool_],
    radius: float,
    spacing: float,
) -> NDArray[np.uint8]:
    """Average scattered colours over an image by a Gaussian of growing radius.

    Parameters
    ----------
    colors : (n, 3) uint8, RGB, n >= 1
    places : (n, 2) int or float, (row, column) of each, inside the image
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
    sums = scatter(colors, np.ascontiguousarray(places, np.float32), *wanted.shape)
    image = np.zeros((*wanted.shape, 3), np.uint8)
    average(sums, wanted, gaussian_taps(radius), _LEAST_WEIGHT / spacing**2, image)
    return image


def inpaint_colors(
    image: NDArray[np.uint8], known: NDArray[np.bool_], missing: NDArray[np.bool_]
) -> None:
    """Fill an image's missing colours with the mean of the known ones around them.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB; changed where `missing`
    known, missing : (rows, columns) bool; at least one is known
    """
    average(planes(image, known), missing, gaussian_taps(1.0), _LEAST_WEIGHT, image)
