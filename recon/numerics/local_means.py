"""Blurs, and local means over part of an image, told at half its resolution."""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics._local_mean_kernels import divided, halved_products

__all__ = ["blurred", "enlarged", "local_means"]

Image = NDArray[np.float32]

# Where a Gaussian ends, in standard deviations: OpenCV's own four take a third longer.
_REACH = 3.0


def blurred(image: Image, sigma: float) -> Image:
    """Filter by a Gaussian of that standard deviation, pixels; zero outside."""
    side = 2 * max(1, round(_REACH * sigma)) + 1
    return np.asarray(
        cv2.GaussianBlur(image, (side, side), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)


def local_means(weight: Image, sigma: float, *values: Image) -> list[Image]:
    """Average images under a Gaussian, (rows, columns) each to half of that, rounded up.

    Parameters
    ----------
    weight : (rows, columns) float32, of each pixel
    sigma : the Gaussian's standard deviation, pixels of the means
    values : (rows, columns) float32
    """
    return list(divided(blurred(halved_products(weight, values), sigma)))


def enlarged(image: Image, shape: tuple[int, ...]) -> Image:
    """Interpolate a local mean, or several, to the shape of what it is of, (rows, columns)."""
    finer = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(finer[:shape[0], :shape[1]], np.float32)
