"""The standard error of dense points, on shapes and noise that are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from denseface.recon.noise import least_risk
from denseface.recon.propagation import densify
from denseface.recon.propagation.uncertainty import _FIT_ALONE, node_statistics
from tests.unit.recon.shapes import NOISE, disc_seeds, fitted, seeds

FRACTION = 0.5
MIN_SIGMA_MM = 0.05


def dense_of(points, spacing, ratio=10.0, least_mm=0.0):
    plan = least_risk(NOISE, spacing, None, 8.0, 3.0)._replace(
        bias_share=FRACTION / _FIT_ALONE.bias, white_share=0.0, smooth_share=0.0, least_mm=least_mm)
    return densify(seeds(points), fitted(points, spacing, 8 * spacing, 3.0), spacing, ratio, plan)


def noisy(xy, height, noise_mm, seed=0):
    z = height(*xy[:, :2].T) + np.random.default_rng(seed).normal(0, noise_mm, len(xy))
    return np.column_stack([xy[:, :2], z]).astype(np.float32)


def ball(x, y):
    return 810 - np.sqrt(110.0**2 - x * x - y * y)


def flat(x, y):
    return 700 + 0 * x


def tilted(x, y):
    return 700 + 1.2 * x


def away(dense):
    return np.hypot(*dense.points[:, :2].T)


def middle(dense, below, above=0.0):
    far = away(dense)
    return float(np.median(dense.sigma[(far >= above) & (far < below)]))


@hypothesis_settings(deadline=None, max_examples=25)
@given(spacing=st.floats(0.8, 3.5), hole=st.floats(0, 0.6), noise=st.floats(0, 20),
       missing=st.floats(0, 0.5), ratio=st.sampled_from([1.0, 4.0, 10.0, 40.0]),
       seed=st.integers(0, 99))
def test_it_is_positive_and_finite_whatever_the_seeds(spacing, hole, noise, missing, ratio, seed):
    xy = disc_seeds(spacing, 18 * spacing, hole * 18 * spacing, seed=seed)
    xy = xy[np.random.default_rng(seed).random(len(xy)) >= missing]
    dense = dense_of(noisy(xy, ball, noise, seed), spacing, ratio=ratio)
    assert dense.sigma.dtype == np.float32
    assert dense.sigma.shape == (len(dense),)
    assert np.isfinite(dense.sigma).all()
    assert dense.sigma.min() >= np.float32(MIN_SIGMA_MM)


def test_it_grows_into_a_hole():
    dense = dense_of(noisy(disc_seeds(1.3, 50, 14), ball, 1.5), 1.3)
    around, edge, half, center = (
        middle(dense, 24, 18), middle(dense, 13, 11), middle(dense, 9, 7), middle(dense, 3))
    assert around < edge < half < center
    assert center > 1.8 * around


def test_it_grows_with_the_distance_from_the_camera():
    """Seeds farther apart and noisier, as a sensor of one focal length sees the same ball."""
    found = [middle(dense_of(noisy(disc_seeds(1.3 * z, 50), ball, 1.2 * z * z), 1.3 * z), 40)
             for z in (1.0, 1.3, 1.6)]
    assert found[0] < found[1] < found[2]
    assert found[2] > 2 * found[0]


def test_it_follows_the_noise_around_a_point():
    xy = disc_seeds(1.3, 50)
    points = noisy(xy, flat, 1.0)
    left = xy[:, 0] < 0
    points[left, 2] = noisy(xy, flat, 3.0)[left, 2]
    dense = dense_of(points, 1.3)
    x, inside = dense.points[:, 0], away(dense) < 40
    quiet, loud = (float(np.median(dense.sigma[inside & side])) for side in (x > 12, x < -12))
    assert quiet == pytest.approx(np.sqrt(FRACTION) * 1.0, rel=0.1)
    assert loud == pytest.approx(np.sqrt(FRACTION) * 3.0, rel=0.1)


def test_it_is_larger_where_the_surface_is_steep():
    xy = disc_seeds(1.3, 50)
    found = [middle(dense_of(noisy(xy, height, 0.5), 1.3), 40) for height in (flat, tilted)]
    assert found[1] > 1.1 * found[0]


def test_it_is_larger_at_the_rim_of_the_same_slope():
    dense = dense_of(noisy(disc_seeds(1.3, 50), tilted, 0.5), 1.3)
    assert middle(dense, 60, above=48) > 1.5 * middle(dense, 40)


def test_nothing_is_known_better_than_whole_millimetres_allow():
    dense = dense_of(noisy(disc_seeds(1.3, 50), flat, 0), 1.3)
    least = dense.sigma[away(dense) < 45] == np.float32(MIN_SIGMA_MM)
    assert least.mean() > 0.99  # the others are in gaps between the seeds


def test_it_moves_with_the_face():
    points = noisy(disc_seeds(1.3, 40, 10), ball, 1.0)
    there = dense_of(points + np.float32([64, -32, 0]), 1.3)
    here = dense_of(points, 1.3)
    np.testing.assert_allclose(np.median(there.sigma), np.median(here.sigma), rtol=1e-2)
    assert len(there) == pytest.approx(len(here), rel=1e-2)


def test_nothing_is_known_better_than_the_levels_of_depth_allow():
    dense = dense_of(noisy(disc_seeds(1.3, 50), flat, 0), 1.3, least_mm=2.3)
    np.testing.assert_array_equal(dense.sigma[away(dense) < 45], np.float32(2.3))


def test_node_statistics_sum_what_is_near_each_node():
    rng = np.random.default_rng(0)
    support = rng.random((23, 17)) < 0.8
    slopes_x, slopes_y = rng.normal(size=(2, 23, 17)).astype(np.float32)
    heights = rng.normal(700, 5, (23, 17)).astype(np.float32)
    cells = rng.integers(0, [23, 17], (200, 2))
    rest = rng.normal(0, 2, 200)
    points = np.column_stack([10 + 0.5 * cells[:, 1], -20 + 0.5 * cells[:, 0],
                              heights[cells[:, 0], cells[:, 1]] + rest]).astype(np.float32)
    surface = np.stack([heights, slopes_x, slopes_y])
    nodes = node_statistics(points, support, surface, (10.0, -20.0), 0.5, 3)
    assert nodes.shape == (8, 6, 4)
    np.testing.assert_array_equal(nodes[..., 0], support[::3, ::3])
    np.testing.assert_allclose(
        nodes[..., 1], np.where(support, slopes_x**2 + slopes_y**2, 0)[::3, ::3], rtol=1e-5)
    on = support[cells[:, 0], cells[:, 1]]
    nearest = np.minimum((cells[on] + 1) // 3, [7, 5])
    count, squares = np.zeros((8, 6)), np.zeros((8, 6))
    np.add.at(count, tuple(nearest.T), 1)
    np.add.at(squares, tuple(nearest.T), rest[on] ** 2)
    np.testing.assert_array_equal(nodes[..., 2], count)
    np.testing.assert_allclose(nodes[..., 3], squares, rtol=1e-3, atol=1e-3)


def test_residuals_follow_the_slope_between_grid_points():
    heights = np.full((4, 4), 700, np.float32) + 0.5 * np.arange(4, dtype=np.float32)
    slope = np.full((4, 4), 0.5, np.float32)
    points = np.array([[1.3, 2.4, 700.65]], np.float32)
    surface = np.stack([heights, slope, 0 * slope])
    nodes = node_statistics(points, np.ones((4, 4), bool), surface, (0.0, 0.0), 1.0, 1)
    assert nodes[2, 1, 2] == 1
    assert nodes[..., 3].max() < 1e-6
