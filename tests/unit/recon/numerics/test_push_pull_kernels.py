"""The steps of push-pull against NumPy."""

import numpy as np

from denseface.recon.numerics._push_pull_kernels import (
    divide,
    halve,
    masked_sums,
    pull,
    splat_colors,
)


def test_means_are_given_where_wanted_and_known():
    sums = np.zeros((1, 4, 4), np.float32)
    sums[0, :3] = ((10, 20, 30, 2), (1, 1, 1, 0.01), (8, 8, 8, 4))
    mean, missing, count = divide(sums, np.array([[True, True, False, True]]), 0.05)
    np.testing.assert_array_equal(mean, [[(5, 10, 15), (0, 0, 0), (0, 0, 0), (0, 0, 0)]])
    np.testing.assert_array_equal(missing, [[False, True, False, True]])
    assert count == 2


def test_half_the_size_is_the_mean_of_four():
    sums = np.random.default_rng(2).uniform(size=(5, 6, 4)).astype(np.float32)
    missing = np.zeros((5, 6), bool)
    missing[2, 3] = missing[4, 0] = True
    half, wanted = halve(sums, missing)
    padded = np.pad(sums, ((0, 1), (0, 0), (0, 0)))
    np.testing.assert_allclose(half, padded.reshape(3, 2, 3, 2, 4).mean(axis=(1, 3)), rtol=1e-6)
    np.testing.assert_array_equal(wanted, [[0, 0, 0], [0, 1, 0], [1, 0, 0]])


def test_what_is_missing_is_pulled_from_half_the_size():
    row, column = np.mgrid[:6, :8]
    ramp = np.dstack([row, column, 30 - row - column]).astype(np.float32)
    # The middle of each four.
    coarse = np.ascontiguousarray(ramp.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3)))
    missing = np.random.default_rng(3).random((6, 8)) < 0.5
    mean = np.where(missing[..., None], np.float32(0), ramp)
    pull(mean, missing, coarse)
    np.testing.assert_allclose(mean[1:-1, 1:-1], ramp[1:-1, 1:-1], atol=1e-5)
    np.testing.assert_array_equal(mean[~missing], ramp[~missing])


def test_a_colour_is_splat_on_the_pixels_around_it():
    sums = splat_colors(np.array([[100, 0, 40], [8, 16, 4]], np.uint8),
                   np.array([[1.25, 2.5], [3, 4]], np.float32), 4, 5)
    np.testing.assert_allclose(sums[1, 2], (37.5, 0, 15, 0.375))
    np.testing.assert_allclose(sums[2, 3], (12.5, 0, 5, 0.125))
    np.testing.assert_allclose(sums[3, 4], (8, 16, 4, 1))
    np.testing.assert_allclose(sums.sum(axis=(0, 1)), (108, 16, 44, 2))


def test_known_pixels_are_counted():
    image = np.random.default_rng(4).integers(0, 256, (6, 7, 3), np.uint8)
    known = np.random.default_rng(5).random((6, 7)) < 0.5
    sums = masked_sums(image, known)
    np.testing.assert_array_equal(sums[..., 3], known)
    np.testing.assert_array_equal(sums[..., :3], np.where(known[..., None], image, 0))
