"""Gaussian filters, and images at half their resolution and back: (rows, columns) float32."""

import cv2
import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.numerics.jit import compiled

__all__ = ["blurred", "downsampled", "filtered", "gaussian_taps", "upsampled"]

_REACH = 3.0
"""Where a Gaussian ends, standard deviations: OpenCV's own four take a third longer."""


def gaussian_taps(sigma: float) -> Floats:
    """Give the taps of a Gaussian of that standard deviation, pixels, to thrice it each way."""
    size = 2 * max(1, round(_REACH * sigma)) + 1
    return np.asarray(cv2.getGaussianKernel(size, sigma, cv2.CV_32F), np.float32).ravel()


@compiled
def filtered(image: Floats, taps: Floats) -> Floats:
    """Filter rows and columns of (rows, columns, channels) alike; zero outside.

    taps : (2 reach + 1,), symmetric

    Compiled: on small images of four channels a third faster than OpenCV's.
    """
    rows, columns, channels = image.shape
    reach = len(taps) // 2
    length = columns * channels
    lines = image.reshape(rows, length)
    out = np.empty((rows, length), np.float32)
    # A row at a time stays in the first-level cache.
    padded = np.zeros(length + 2 * reach * channels, np.float32)
    nothing = np.zeros(length, np.float32)
    for row in range(rows):
        mixed = padded[reach * channels:reach * channels + length]
        factor, line = taps[reach], lines[row]
        for i in range(length):
            mixed[i] = factor * line[i]
        for k in range(1, min(reach, max(row, rows - 1 - row)) + 1):
            factor = taps[reach + k]
            before = lines[row - k] if k <= row else nothing
            after = lines[row + k] if row + k < rows else nothing
            for i in range(length):
                mixed[i] += factor * (before[i] + after[i])
        along = out[row]
        factor = taps[reach]
        for i in range(length):
            along[i] = factor * mixed[i]
        for k in range(1, reach + 1):
            factor = taps[reach + k]
            before = padded[(reach - k) * channels:(reach - k) * channels + length]
            after = padded[(reach + k) * channels:(reach + k) * channels + length]
            for i in range(length):
                along[i] += factor * (before[i] + after[i])
    return out.reshape(rows, columns, channels)


def blurred(image: Floats, sigma: float) -> Floats:
    """Filter by a Gaussian of that standard deviation, pixels; zero outside."""
    side = 2 * max(1, round(_REACH * sigma)) + 1
    return np.asarray(
        cv2.GaussianBlur(image, (side, side), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)


def downsampled(image: Floats) -> Floats:
    """Average each four pixels, the edge repeated: half of the rows and columns, rounded up."""
    rows, columns = image.shape
    even = cv2.copyMakeBorder(image, 0, rows % 2, 0, columns % 2, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA),
                      np.float32)


def upsampled(image: Floats, shape: tuple[int, ...]) -> Floats:
    """Interpolate a downsampled image, of any channels, to its former (rows, columns)."""
    finer = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(finer[:shape[0], :shape[1]], np.float32)
