"""Colours as the mean of their neighbours: near ones where there are any, else farther ones."""

import cv2
import numpy as np
from numpy.typing import NDArray

from recon._image_kernels import blur, divide, fill, halve, scatter

__all__ = ["average_neighbors"]

_LEAST_WEIGHT = 0.05
# The blur's, in units of its radius.
_REACH = 4
_SMALLEST = 4


def average_neighbors(
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
    # Channel 3 counts the colours: a mean is sum over count, blurred alike.
    sums = scatter(colors, np.ascontiguousarray(places, np.float32), *wanted.shape)
    mean = _mean(sums, wanted, radius, _LEAST_WEIGHT / spacing**2)
    return np.asarray(cv2.convertScaleAbs(mean), np.uint8)  # rounds


def _mean(
    sums: NDArray[np.float32], wanted: NDArray[np.bool_], radius: float, least: float
) -> NDArray[np.float32]:
    """Blur; where there is too little near, ask the same of the image at half its size."""
    reach = round(_REACH * radius)
    taps = np.asarray(cv2.getGaussianKernel(2 * reach + 1, radius, cv2.CV_32F), np.float32)
    blurred = blur(sums, taps.ravel())
    smallest = max(wanted.shape) <= _SMALLEST
    mean, missing = divide(blurred, wanted, 0.0 if smallest else least)
    if missing.any() and not smallest:
        half, below = halve(blurred, missing)
        coarse = _mean(half, cv2.dilate(below, np.ones((5, 5), np.uint8)) > 0, radius, least)
        fill(mean, missing, coarse)
    return mean
