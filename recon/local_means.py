"""Blurs, and local means over part of an image, told at half its resolution."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["blurred", "enlarged", "local_means", "shrunk"]

Image = NDArray[np.float32]


def blurred(image: Image, sigma: float) -> Image:
    """Filter by a Gaussian of that standard deviation, pixels; zero outside."""
    return np.asarray(
        cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)


def shrunk(image: Image) -> Image:
    """Average each four pixels, of (rows, columns) or more of them one behind the other."""
    rows, columns = (-(-side // 2) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)


def local_means(weight: Image, sigma: float, *values: Image) -> list[Image]:
    """Average images under a Gaussian, (rows, columns) each to half of that, rounded up.

    Parameters
    ----------
    weight : (rows, columns) float32, of each pixel
    sigma : the Gaussian's standard deviation, pixels of the means
    values : (rows, columns) float32
    """
    planes = shrunk(np.asarray(cv2.merge([weight, *(weight * one for one in values)]), np.float32))
    share, *sums = cv2.split(blurred(planes, sigma))
    share = np.maximum(share, np.float32(1e-6))
    return [np.asarray(one / share, np.float32) for one in sums]


def enlarged(image: Image, shape: tuple[int, ...]) -> Image:
    """Interpolate a local mean to the shape of what it is of, (rows, columns)."""
    return np.asarray(
        cv2.resize(image, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), np.float32)
