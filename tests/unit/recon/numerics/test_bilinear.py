"""Images read between their points against NumPy."""

import numpy as np

from denseface.recon.numerics.bilinear import add_resampled


def test_a_resampled_image_is_added():
    image = np.random.default_rng(0).normal(size=(9, 13)).astype(np.float32)
    ramp = np.add.outer(0.2 * np.arange(4), 0.05 * np.arange(5)).astype(np.float32)
    rows, columns = (np.linspace(0, last, count).astype(np.float32)
                     for last, count in ((3, 9), (4, 13)))
    expected = image + np.add.outer(0.2 * rows, 0.05 * columns)
    add_resampled(image, ramp, rows, columns)
    np.testing.assert_allclose(image, expected, atol=1e-5)
