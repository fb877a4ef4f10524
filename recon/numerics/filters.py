"""Gaussian filters, and images at half their resolution and back."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["blurred", "downsampled", "gaussian_taps", "upsampled"]

Image = NDArray[np.float32]

# Where a Gaussian ends, in standard deviations: OpenCV's own four take a third longer.
_REACH = 3.0


def gaussian_taps(sigma: float) -> NDArray[np.float32]:
    """Give the taps of a Gaussian of that standard deviation, pixels, to thrice it each way."""
    size = 2 * max(1, round(3 * sigma)) + 1
    return np.asarray(cv2.getGaussianKernel(size, sigma, cv2.CV_32F), np.float32).ravel()


def blurred(image: Image, sigma: float) -> Image:
    """Filter by a Gaussian of that standard deviation, pixels; zero outside."""
    side = 2 * max(1, round(_REACH * sigma)) + 1
    return np.asarray(
        cv2.GaussianBlur(image, (side, side), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)



def downsampled(image: Image) -> Image:
    """The mean of every four pixels; beyond the edge it goes on."""
    rows, columns = image.shape
    even = cv2.copyMakeBorder(image, 0, rows % 2, 0, columns % 2, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA),
                      np.float32)



def upsampled(image: Image, shape: tuple[int, ...]) -> Image:
    """Interpolate a downsampled image, of any channels, to its former (rows, columns)."""
    finer = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(finer[:shape[0], :shape[1]], np.float32)
