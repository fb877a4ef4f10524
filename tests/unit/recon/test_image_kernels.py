"""The compiled loops over the dense grid against NumPy."""

import numpy as np
import pytest

from recon._image_kernels import add_between, collect, unset


def test_the_supported_points_are_collected_row_by_row():
    rng = np.random.default_rng(1)
    support = rng.random((7, 9)) < 0.4
    xs, ys = np.arange(9) * 0.5 - 2, np.arange(7) * 0.5 + 1
    heights, slopes_x, slopes_y = rng.normal(size=(3, 7, 9)).astype(np.float32)
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    sigma = rng.random((7, 9)).astype(np.float32)
    points, normals, colors, errors, cells = collect(
        support, xs, ys, heights, slopes_x, slopes_y, np.pad(image, ((0, 1), (0, 1), (0, 0))), 1,
        np.pad(sigma, (0, 1)), 1)
    np.testing.assert_array_equal(errors, sigma[support])
    np.testing.assert_array_equal(cells, np.argwhere(support))
    np.testing.assert_array_equal(colors, image[support])
    row, column = cells.T
    np.testing.assert_array_equal(
        points, np.column_stack([xs[column], ys[row], heights[support]]).astype(np.float32))
    expected = np.column_stack(
        [slopes_x[support], slopes_y[support], -np.ones(len(points))])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, expected, atol=1e-6)


@pytest.mark.parametrize(("every", "each"), [(1, 2), (2, 3), (3, 1)])
@pytest.mark.parametrize("shape", [(7, 9), (6, 4), (1, 1)])
def test_colours_and_errors_between_the_given_ones_are_in_between(every, each, shape):
    rows, columns = shape
    tall, wide = ((side - 1) // every + 2 for side in shape)
    i, j = np.mgrid[:(rows - 1) // each + 2, :(columns - 1) // each + 2].astype(np.float32)
    ramp = 10 * every * np.arange(tall)[:, None] + 3 * every * np.arange(wide)
    empty = np.zeros(shape, np.float32)
    _, _, colors, errors, cells = collect(
        np.ones(shape, bool), np.arange(float(columns)), np.arange(float(rows)), empty, empty,
        empty, np.dstack([ramp, ramp, 200 - ramp]).astype(np.uint8), every,
        2 + each * (0.3 * i - 0.1 * j), each)
    np.testing.assert_allclose(errors, 2 + cells @ (0.3, -0.1), atol=1e-5)
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
    points, normals, colors, errors, cells = collect(
        np.zeros((3, 4), bool), np.arange(4.0), np.arange(3.0), empty, empty, empty,
        np.zeros((4, 5, 3), np.uint8), 1, np.zeros((4, 5), np.float32), 1)
    assert points.shape == normals.shape == colors.shape == (0, 3)
    assert errors.shape == (0,)
    assert cells.shape == (0, 2)


def test_the_cells_where_an_image_is_zero():
    image = (np.random.default_rng(2).random((8, 9)) < 0.6).astype(np.uint8)
    cells = np.argwhere(np.random.default_rng(3).random((8, 9)) < 0.5).astype(np.int32)
    expected = np.flatnonzero(image[cells[:, 0], cells[:, 1]] == 0)
    assert 0 < len(expected) < len(cells)
    np.testing.assert_array_equal(unset(image, cells), expected)
    assert len(unset(image, cells[:0])) == 0
