"""Means over part of an image."""

import numpy as np
import pytest

from denseface.recon.numerics.local_means import enlarged, local_means


@pytest.fixture
def image():
    return np.random.default_rng(0).normal(5, 2, (60, 81)).astype(np.float32)


def test_a_constant_is_its_own_mean_up_to_the_border_of_the_part(image):
    weight = (image > 5).astype(np.float32)
    means, = local_means(weight, 3.0, np.full_like(image, 7))
    assert means.shape == (30, 41)
    np.testing.assert_allclose(means, 7, rtol=1e-5)


def test_what_is_off_the_part_does_not_count(image):
    weight = np.zeros_like(image)
    weight[:, :40] = 1
    spoilt = image.copy()
    spoilt[:, 40:] = 1e4
    for one, other in zip(local_means(weight, 2.0, image, image**2),
                          local_means(weight, 2.0, spoilt, spoilt**2), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_wide_mean_is_that_of_the_whole(image):
    means, = local_means(np.ones_like(image), 200.0, image)
    assert means[15, 20] == pytest.approx(image.mean(), abs=0.05)


def test_nothing_gives_zero(image):
    means, = local_means(np.zeros_like(image), 3.0, image)
    np.testing.assert_array_equal(means, 0)


def test_enlarged_to_the_very_shape(image):
    means, = local_means(np.ones_like(image), 3.0, image)
    assert enlarged(means, image.shape).shape == image.shape
