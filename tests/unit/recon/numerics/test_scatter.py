"""Between scattered points and pixels."""

import numpy as np

from denseface.recon.numerics.scatter import (
    interpolate,
    occupancy,
    pixel_coordinates,
    splat,
    xy_bounds,
)


def test_bounds_are_the_least_and_the_largest():
    points = np.random.default_rng(4).normal(size=(50, 3)).astype(np.float32)
    least, most = points.min(axis=0), points.max(axis=0)
    assert xy_bounds(points) == (least[0], most[0], least[1], most[1])
    assert xy_bounds(points[:1]) == (*points[0, [0, 0]], *points[0, [1, 1]])


def test_the_pixel_nearest_to_a_point_is_occupied():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.4, 3.4, (20, 3)).astype(np.float32) * 2 + (10, -20, 0)
    points = points.astype(np.float32)
    image = occupancy(points, (10.0, -20.0), 2.0, 4, 4)
    expected = np.zeros((4, 4), np.uint8)
    columns, rows = np.rint((points[:, :2] - (10, -20)) / 2).astype(int).T
    expected[rows, columns] = 1
    np.testing.assert_array_equal(image, expected)


def test_coordinates_count_pixels_and_are_never_negative():
    points = np.array([[10, -20, 700], [11, -17, 700], [9.999, -20.001, 0]], np.float32)
    np.testing.assert_allclose(pixel_coordinates(points, (10.0, -20.0), 2.0),
                               [[0, 0], [1.5, 0.5], [0, 0]])


def test_a_splat_keeps_its_sum_and_its_centroid():
    rng = np.random.default_rng(1)
    columns, rows = rng.uniform(0, 5.9, (2, 30)).astype(np.float32)
    values = rng.normal(size=30).astype(np.float32)
    counts, sums = np.zeros((2, 7, 7), np.float32)
    splat(columns, rows, values, counts, sums)
    i, j = np.mgrid[:7, :7]
    for image, shared in ((sums, values), (counts, np.ones(30))):
        for found, expected in ((image, shared), (i * image, rows * shared),
                                (j * image, columns * shared)):
            np.testing.assert_allclose(found.sum(), expected.sum(), atol=1e-4)


def test_interpolation_is_exact_on_a_ramp():
    rng = np.random.default_rng(2)
    columns, rows = rng.uniform(0, 5.9, (2, 30)).astype(np.float32)
    i, j = np.mgrid[:7, :7].astype(np.float32)
    np.testing.assert_allclose(
        interpolate(3 * i - 2 * j, columns, rows), 3 * rows - 2 * columns, atol=1e-5)
