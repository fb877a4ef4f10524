"""Filters against OpenCV's."""

import cv2
import numpy as np
import pytest

from denseface.recon.numerics.filters import filtered


@pytest.mark.parametrize("shape", [(40, 60), (3, 5), (1, 1), (200, 2)])
@pytest.mark.parametrize("radius", [0.5, 1.6, 3])
def test_filtering_is_opencvs(shape, radius):
    image = np.random.default_rng(0).uniform(0, 255, (*shape, 4)).astype(np.float32)
    size = 2 * round(4 * radius) + 1
    taps = np.asarray(cv2.getGaussianKernel(size, radius, cv2.CV_32F), np.float32).ravel()
    expected = cv2.GaussianBlur(image, (size, size), radius, borderType=cv2.BORDER_CONSTANT)
    np.testing.assert_allclose(filtered(image, taps), expected.reshape(image.shape), atol=1e-3)
