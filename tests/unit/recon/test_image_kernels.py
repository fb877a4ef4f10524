"""The compiled loops over the dense grid against NumPy and OpenCV."""

import cv2
import numpy as np
import pytest

from recon._image_kernels import blur, collect, divide


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
        support, xs, ys, heights, slopes_x, slopes_y, image)
    np.testing.assert_array_equal(cells, np.argwhere(support))
    np.testing.assert_array_equal(colors, image[support])
    row, column = cells.T
    np.testing.assert_array_equal(
        points, np.column_stack([xs[column], ys[row], heights[support]]).astype(np.float32))
    expected = np.column_stack(
        [slopes_x[support], slopes_y[support], -np.ones(len(points))])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, expected, atol=1e-6)


def test_nothing_supported_is_nothing_collected():
    empty = np.zeros((3, 4), np.float32)
    points, normals, colors, cells = collect(
        np.zeros((3, 4), bool), np.arange(4.0), np.arange(3.0), empty, empty, empty,
        np.zeros((3, 4, 3), np.uint8))
    assert points.shape == normals.shape == colors.shape == (0, 3)
    assert cells.shape == (0, 2)
