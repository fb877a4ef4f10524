"""The loops of local moments against NumPy."""

import numpy as np
import pytest

from denseface.recon.detail._symmetry_kernels import (
    correction,
    mirror_moments,
    peak_differences,
    shrinkage_factors,
)

SHAPES = [(24, 30), (23, 31)]


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def quarters(image):
    """The mean of each four pixels, zero beyond the edge."""
    rows, columns = (side + side % 2 for side in image.shape)
    whole = np.zeros((rows, columns))
    whole[:image.shape[0], :image.shape[1]] = image
    return whole.reshape(rows // 2, 2, columns // 2, 2).mean(axis=(1, 3))


@pytest.mark.parametrize("shape", SHAPES)
def test_moments_are_of_what_was_measured(rng, shape):
    planes = rng.normal(size=(*shape, 5)).astype(np.float32)
    image = rng.random((5, *shape)).astype(np.float32)
    image[2, ::3] = 0
    hole = (rng.random(shape) < 0.3) * rng.random(shape).astype(np.float32)
    gap, _, weight, other, seeded = image.astype(float)
    own, measured = planes[..., 3].astype(float), weight * (1 - hole)
    both = measured * seeded
    moments, differences, gaps = mirror_moments(planes, image, hole)
    for found, wanted in (
        *zip(np.moveaxis(moments, -1, 0), (both, both * (own**2 + other**2), both * own * other),
             strict=True),
        *zip(np.moveaxis(gaps, -1, 0), (measured, measured * gap**2), strict=True),
    ):
        np.testing.assert_allclose(found, 4 * quarters(wanted), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(differences, np.stack([both, both * (own - other)], axis=-1),
                               rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("shape", SHAPES)
def test_peaks_are_the_largest_of_each_four_that_count(rng, shape):
    differences, blurred = (rng.random((*shape, 2)).astype(np.float32) for _ in range(2))
    differences[:4, :6, 0] = differences[::2, ::3, 0] = 0
    squared = np.where(differences[..., 0] > 0, (blurred[..., 1] / blurred[..., 0])**2, 0)
    found = peak_differences(differences, blurred, 0.7)
    whole = np.pad(squared, [(0, side % 2) for side in shape])
    expected = whole.reshape(found.shape[0], 2, found.shape[1], 2).max(axis=(1, 3))
    np.testing.assert_allclose(found, 0.7 * expected, rtol=1e-4)
    assert not found[:2, :3].any()


def test_the_shrinkage_factors_are_of_least_squared_error(rng):
    """c1 d + c2 d' for signals of variance P and covariance C, each with noise of variance v."""
    v = 0.3
    power, noise = 1.2, rng.normal(0, np.sqrt(v), (2, 400_000))
    common = rng.normal(0, 1, noise.shape[1])
    signals = [np.sqrt(power) * (0.8 * common + 0.6 * rng.normal(size=common.size))
               for _ in range(2)]
    seen = np.stack(signals) + noise
    expected = np.linalg.lstsq(seen.T, signals[0], rcond=None)[0]
    moments = np.array([[[2, 2 * (seen**2).sum(axis=0).mean(), 2 * seen.prod(axis=0).mean()]]],
                       np.float32)
    for alike in (1.0, 0.5):
        found = shrinkage_factors(moments, np.full((1, 1), alike, np.float32), v)[0, 0]
        np.testing.assert_allclose(found, [*(alike * expected), alike], atol=5e-3)


def test_of_noise_alone_nothing_is_kept():
    moments = np.array([[[1, 0.5, 0.2]]], np.float32)
    np.testing.assert_array_equal(shrinkage_factors(moments, np.ones((1, 1), np.float32), 0.3),
                                  [[[0, 0, 1]]])


def test_what_the_mirror_image_adds(rng):
    shape = (9, 11)
    planes = rng.random((*shape, 5)).astype(np.float32) + np.float32(0.1)
    image = rng.random((5, *shape)).astype(np.float32)
    kept, hole, gap_energy = (rng.random(shape).astype(np.float32) for _ in range(3))
    factors = rng.random((*shape, 3)).astype(np.float32)
    v, least = 0.25, 0.2
    _, facing, _, own, seeded = np.moveaxis(planes.astype(float), -1, 0)
    gap, whole, weight, other, there = image.astype(float)
    first, second, alike = np.moveaxis(factors, -1, 0)
    found = (1 - hole) * (first * own + second * other - alike * kept * facing)
    here, there = v / np.maximum(seeded, least), v / np.maximum(there, least)
    found += here / np.maximum(here + there, gap_energy) * (gap + hole * (whole - gap))
    np.testing.assert_allclose(
        correction(planes, image, kept, hole, factors, gap_energy, v),
        weight * found / facing, rtol=1e-4, atol=1e-5)
