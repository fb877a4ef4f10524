"""Means over part of an image."""

import numpy as np
import pytest

from denseface.recon.numerics.filters import upsampled
from denseface.recon.numerics.normalized_convolution import normalized, normalized_convolution


@pytest.fixture
def image():
    return np.random.default_rng(0).normal(5, 2, (60, 81)).astype(np.float32)


def test_a_constant_is_its_own_mean_up_to_the_border_of_the_part(image):
    weight = (image > 5).astype(np.float32)
    means, = normalized_convolution(weight, 3.0, np.full_like(image, 7))
    assert means.shape == (30, 41)
    np.testing.assert_allclose(means, 7, rtol=1e-5)


def test_what_is_off_the_part_does_not_count(image):
    weight = np.zeros_like(image)
    weight[:, :40] = 1
    spoilt = image.copy()
    spoilt[:, 40:] = 1e4
    for one, other in zip(normalized_convolution(weight, 2.0, image, image**2),
                          normalized_convolution(weight, 2.0, spoilt, spoilt**2), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_wide_mean_is_that_of_the_whole(image):
    means, = normalized_convolution(np.ones_like(image), 200.0, image)
    assert means[15, 20] == pytest.approx(image.mean(), abs=0.05)


def test_nothing_gives_zero(image):
    means, = normalized_convolution(np.zeros_like(image), 3.0, image)
    np.testing.assert_array_equal(means, 0)


def test_upsampled_to_the_very_shape(image):
    means, = normalized_convolution(np.ones_like(image), 3.0, image)
    assert upsampled(means, image.shape).shape == image.shape


@pytest.mark.parametrize("shape", [(24, 30), (23, 31)])
def test_each_four_pixels_are_averaged_by_their_weights(shape):
    rng = np.random.default_rng(3)
    weight, value = (rng.random(shape).astype(np.float32) for _ in range(2))
    pad = [(0, side % 2) for side in shape]
    products, weights = (
        np.pad(image, pad).reshape((shape[0] + 1) // 2, 2, -1, 2).sum(axis=(1, 3))
        for image in (weight * value, weight))
    means, = normalized_convolution(weight, 1e-3, value)
    np.testing.assert_allclose(means, products / weights, rtol=1e-5)


def test_a_weight_of_nearly_nothing_is_not_divided_by():
    planes = np.random.default_rng(3).random((5, 7, 3)).astype(np.float32)
    planes[2, 3] = 0
    found = normalized(planes)
    assert not found[:, 2, 3].any()
    planes[2, 3, 0] = 1
    np.testing.assert_allclose(found, np.moveaxis(planes[..., 1:] / planes[..., :1], -1, 0),
                               rtol=1e-5)
