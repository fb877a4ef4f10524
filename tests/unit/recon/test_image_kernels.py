"""The compiled loops over the dense grid against NumPy and OpenCV."""

import cv2
import numpy as np
import pytest

from recon._image_kernels import add_between, blur, collect, divide, fill, halve, scatter


@pytest.mark.parametrize("shape", [(40, 60), (3, 5), (1, 1), (200, 2)])
@pytest.mark.parametrize("radius", [0.5, 1.6, 3])
def test_the_blur_is_opencvs(shape, radius):
    image = np.random.default_rng(0).uniform(0, 255, (*shape, 4)).astype(np.float32)
    size = 2 * round(4 * radius) + 1
    taps = np.asarray(cv2.getGaussianKernel(size, radius, cv2.CV_32F), np.float32).ravel()
    expected = cv2.GaussianBlur(image, (size, size), radius, borderType=cv2.BORDER_CONSTANT)
    np.testing.assert_allclose(blur(image, taps), expected.reshape(image.shape), atol=1e-3)


def test_means_are_given_where_wanted_and_known():
    sums = np.zeros((1, 4, 4), np.float32)
    sums[0, :3] = ((10, 20, 30, 2), (1, 1, 1, 0.01), (8, 8, 8, 4))
    mean, missing = divide(sums, np.array([[True, True, False, True]]), 0.05)
    np.testing.assert_array_equal(mean, [[(5, 10, 15), (0, 0, 0), (0, 0, 0), (0, 0, 0)]])
    np.testing.assert_array_equal(missing, [[False, True, False, True]])


def test_the_supported_points_are_collected_row_by_row():
    rng = np.random.default_rng(1)
    support = rng.random((7, 9)) < 0.4
    xs, ys = np.arange(9) * 0.5 - 2, np.arange(7) * 0.5 + 1
    heights, slopes_x, slopes_y = rng.normal(size=(3, 7, 9)).astype(np.float32)
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    points, normals, colors, cells = collect(
        support, xs, ys, heights, slopes_x, slopes_y, np.pad(image, ((0, 1), (0, 1), (0, 0))), 1)
    np.testing.assert_array_equal(cells, np.argwhere(support))
    np.testing.assert_array_equal(colors, image[support])
    row, column = cells.T
    np.testing.assert_array_equal(
        points, np.column_stack([xs[column], ys[row], heights[support]]).astype(np.float32))
    expected = np.column_stack(
        [slopes_x[support], slopes_y[support], -np.ones(len(points))])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, expected, atol=1e-6)


@pytest.mark.parametrize("every", [1, 2, 3])
@pytest.mark.parametrize("shape", [(7, 9), (6, 4), (1, 1)])
def test_colours_between_the_given_ones_are_in_between(every, shape):
    rows, columns = shape
    tall, wide = ((side - 1) // every + 2 for side in shape)
    ramp = 10 * every * np.arange(tall)[:, None] + 3 * every * np.arange(wide)
    empty = np.zeros(shape, np.float32)
    _, _, colors, cells = collect(
        np.ones(shape, bool), np.arange(float(columns)), np.arange(float(rows)), empty, empty,
        empty, np.dstack([ramp, ramp, 200 - ramp]).astype(np.uint8), every)
    expected = cells @ (10, 3)
    np.testing.assert_array_equal(colors, np.column_stack([expected, expected, 200 - expected]))


def test_half_the_size_is_the_mean_of_four():
    sums = np.random.default_rng(2).uniform(size=(5, 6, 4)).astype(np.float32)
    missing = np.zeros((5, 6), bool)
    missing[2, 3] = missing[4, 0] = True
    half, wanted = halve(sums, missing)
    padded = np.pad(sums, ((0, 1), (0, 0), (0, 0)))
    np.testing.assert_allclose(half, padded.reshape(3, 2, 3, 2, 4).mean(axis=(1, 3)), rtol=1e-6)
    np.testing.assert_array_equal(wanted, [[0, 0, 0], [0, 1, 0], [1, 0, 0]])


def test_what_is_missing_is_filled_from_half_the_size():
    row, column = np.mgrid[:6, :8]
    ramp = np.dstack([row, column, 30 - row - column]).astype(np.float32)
    # The middle of each four.
    coarse = np.ascontiguousarray(ramp.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3)))
    missing = np.random.default_rng(3).random((6, 8)) < 0.5
    mean = np.where(missing[..., None], np.float32(0), ramp)
    fill(mean, missing, coarse)
    np.testing.assert_allclose(mean[1:-1, 1:-1], ramp[1:-1, 1:-1], atol=1e-5)
    np.testing.assert_array_equal(mean[~missing], ramp[~missing])


def test_what_is_added_is_read_between_its_points():
    image = np.random.default_rng(0).normal(size=(9, 13)).astype(np.float32)
    ramp = np.add.outer(0.2 * np.arange(4), 0.05 * np.arange(5)).astype(np.float32)
    rows, columns = (np.linspace(0, last, count).astype(np.float32)
                     for last, count in ((3, 9), (4, 13)))
    expected = image + np.add.outer(0.2 * rows, 0.05 * columns)
    add_between(image, ramp, rows, columns)
    np.testing.assert_allclose(image, expected, atol=1e-5)


def test_a_colour_is_shared_among_the_pixels_around_it():
    sums = scatter(np.array([[100, 0, 40], [8, 16, 4]], np.uint8),
                   np.array([[1.25, 2.5], [3, 4]], np.float32), 4, 5)
    np.testing.assert_allclose(sums[1, 2], (37.5, 0, 15, 0.375))
    np.testing.assert_allclose(sums[2, 3], (12.5, 0, 5, 0.125))
    np.testing.assert_allclose(sums[3, 4], (8, 16, 4, 1))
    np.testing.assert_allclose(sums.sum(axis=(0, 1)), (108, 16, 44, 2))


def test_nothing_supported_is_nothing_collected():
    empty = np.zeros((3, 4), np.float32)
    points, normals, colors, cells = collect(
        np.zeros((3, 4), bool), np.arange(4.0), np.arange(3.0), empty, empty, empty,
        np.zeros((4, 5, 3), np.uint8), 1)
    assert points.shape == normals.shape == colors.shape == (0, 3)
    assert cells.shape == (0, 2)
