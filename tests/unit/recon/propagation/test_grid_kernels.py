"""The compiled loops over the dense grid against NumPy."""

import numpy as np
import pytest

from denseface.recon.propagation._grid_kernels import Resampling, gather_points, indices_of_zeros


def positions(count):
    return np.arange(count, dtype=np.float32)


def coarser(planes, every, rows, columns):
    """Planes at every so many points of a grid."""
    return Resampling(np.asarray(planes, np.float32), *(
        places / np.float32(every) for places in (rows, columns)))


def test_the_supported_points_are_gathered_row_by_row():
    rng = np.random.default_rng(1)
    support = rng.random((7, 9)) < 0.4
    xs, ys = np.arange(9) * 0.5 - 2, np.arange(7) * 0.5 + 1
    values = rng.normal(size=(3, 7, 9)).astype(np.float32)
    heights, slopes_x, slopes_y = values
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    sigma = rng.random((7, 9)).astype(np.float32)
    points, normals, colors, errors, cells = gather_points(
        support, xs, ys, *(Resampling(planes, positions(7), positions(9)) for planes in (
            values, np.moveaxis(image, -1, 0).astype(np.float32), sigma[None])))
    np.testing.assert_array_equal(errors, sigma[support])
    np.testing.assert_array_equal(cells, np.argwhere(support))
    np.testing.assert_array_equal(colors, image[support])
    row, column = cells.T
    np.testing.assert_allclose(
        points, np.column_stack([xs[column], ys[row], heights[support]]), atol=1e-6)
    expected = np.column_stack(
        [slopes_x[support], slopes_y[support], -np.ones(len(points))])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, expected, atol=1e-6)


@pytest.mark.parametrize(("every", "each"), [(1, 2), (2, 3), (3, 1)])
@pytest.mark.parametrize("finer", [0.4, 1.0, 1.7])
@pytest.mark.parametrize("shape", [(7, 9), (6, 4), (2, 2)])
def test_what_is_between_the_given_points_is_in_between(every, each, finer, shape):
    """Colours at every so many points, heights, slopes and errors on a grid of their own."""
    rows, columns = shape
    tall, wide = ((side - 1) // every + 2 for side in shape)
    ramp = 10 * every * np.arange(tall)[:, None] + 3 * every * np.arange(wide)
    down, right = positions(rows) / np.float32(finer), positions(columns) / np.float32(finer)
    own = [int(np.ceil(side[-1])) + 1 for side in (down, right)]
    i, j = np.mgrid[:own[0], :own[1]].astype(np.float32)
    values = np.stack([700 + 3 * i - 2 * j, 0.02 * i + 0.01 * j, -0.03 * i])
    i, j = np.mgrid[:(own[0] - 1) // each + 2, :(own[1] - 1) // each + 2].astype(np.float32)
    points, normals, colors, errors, cells = gather_points(
        np.ones(shape, bool), np.arange(float(columns)), np.arange(float(rows)),
        Resampling(values, down, right),
        coarser([ramp, ramp, 200 - ramp], every, positions(rows), positions(columns)),
        coarser([2 + each * (0.3 * i - 0.1 * j)], each, down, right))
    y, x = (cells / finer).T
    np.testing.assert_allclose(points[:, 2], 700 + 3 * y - 2 * x, atol=2e-4)
    np.testing.assert_allclose(normals[:, 0] / -normals[:, 2], 0.02 * y + 0.01 * x, atol=1e-5)
    np.testing.assert_allclose(normals[:, 1] / -normals[:, 2], -0.03 * y, atol=1e-5)
    np.testing.assert_allclose(errors, 2 + 0.3 * y - 0.1 * x, atol=1e-5)
    expected = cells @ (10, 3)
    np.testing.assert_array_equal(colors, np.column_stack([expected, expected, 200 - expected]))


def test_nothing_supported_is_nothing_gathered():
    points, normals, colors, errors, cells = gather_points(
        np.zeros((3, 4), bool), np.arange(4.0), np.arange(3.0),
        *(Resampling(np.zeros((planes, 3, 4), np.float32), positions(3), positions(4))
          for planes in (3, 3, 1)))
    assert points.shape == normals.shape == colors.shape == (0, 3)
    assert errors.shape == (0,)
    assert cells.shape == (0, 2)


def test_the_cells_where_an_image_is_zero():
    image = (np.random.default_rng(2).random((8, 9)) < 0.6).astype(np.uint8)
    cells = np.argwhere(np.random.default_rng(3).random((8, 9)) < 0.5).astype(np.int32)
    expected = np.flatnonzero(image[cells[:, 0], cells[:, 1]] == 0)
    assert 0 < len(expected) < len(cells)
    found = indices_of_zeros(image, positions(8), positions(9), cells)
    np.testing.assert_array_equal(found, expected)
    assert len(indices_of_zeros(image, positions(8), positions(9), cells[:0])) == 0
    finer = np.argwhere(np.ones((15, 17), bool)).astype(np.int32)
    near = (finer + 1) // 2
    np.testing.assert_array_equal(
        indices_of_zeros(image, positions(15) / 2, positions(17) / 2, finer),
        np.flatnonzero(image[near[:, 0], near[:, 1]] == 0))
