"""Colours as the mean of their neighbours: near ones where there are any, else farther ones."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["average_neighbors"]

_LEAST_WEIGHT = 0.05
_ANY_WEIGHT = 1e-12


def average_neighbors(
    colors: NDArray[np.uint8],
    places: NDArray[np.integer],
    wanted: NDArray[np.bool_],
    radius: float,
    spacing: float,
) -> NDArray[np.uint8]:
    """Average scattered colours over an image by a Gaussian of growing radius.

    Parameters
    ----------
    colors : (n, 3) uint8, RGB, n >= 1
    places : (n, 2) int, (row, column) of each
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
    shape = wanted.shape
    flat = places[:, 0] * shape[1] + places[:, 1]
    # The last channel counts the colours: the mean is sum over count, blurred alike.
    sums = np.stack([
        np.bincount(flat, weights, minlength=shape[0] * shape[1]).reshape(shape)
        for weights in (*colors.T.astype(np.float64), None)
    ], axis=-1).astype(np.float32)
    mean = np.zeros((*shape, 3), np.float32)
    unknown = wanted.copy()
    least = _LEAST_WEIGHT / spacing**2
    while unknown.any():
        blurred = cv2.GaussianBlur(sums, (0, 0), radius, borderType=cv2.BORDER_CONSTANT)
        reaches_all = radius > max(shape)
        now = unknown & (blurred[..., 3] > (_ANY_WEIGHT if reaches_all else least))
        mean[now] = blurred[now, :3] / blurred[now, 3:]
        if reaches_all:
            break
        unknown &= ~now
        radius *= 2
    return np.rint(mean).astype(np.uint8)
