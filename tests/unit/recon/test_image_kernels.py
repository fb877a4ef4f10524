"""The compiled loops over the dense grid against NumPy."""

import numpy as np
import pytest

from recon._image_kernels import add_between, collect


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


def test_what_is_added_is_read_between_its_points():
    image = np.random.default_rng(0).normal(size=(9, 13)).astype(np.float32)
    ramp = np.add.outer(0.2 * np.arange(4), 0.05 * np.arange(5)).astype(np.float32)
    rows, columns = (np.linspace(0, last, count).astype(np.float32)
                     for last, count in ((3, 9), (4, 13)))
    expected = image + np.add.outer(0.2 * rows, 0.05 * columns)
    add_between(image, ramp, rows, columns)
    np.testing.assert_allclose(image, expected, atol=1e-5)


def test_nothing_supported_is_nothing_collected():
    empty = np.zeros((3, 4), np.float32)
    points, normals, colors, cells = collect(
        np.zeros((3, 4), bool), np.arange(4.0), np.arange(3.0), empty, empty, empty,
        np.zeros((4, 5, 3), np.uint8), 1)
    assert points.shape == normals.shape == colors.shape == (0, 3)
    assert cells.shape == (0, 2)
