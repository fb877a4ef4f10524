"""Slopes on a grid against NumPy."""

import numpy as np
import pytest

from denseface.recon.detail._detail_kernels import (
    blend_toward,
    mirror_planes,
    normalize_sums,
    with_slopes,
)


def numpys(heights, step):
    """Central differences; at the edge half of the difference to the one neighbour."""
    padded = np.pad(heights.astype(np.float64), 1, mode="edge")
    return ((padded[1:-1, 2:] - padded[1:-1, :-2]) / (2 * step),
            (padded[2:, 1:-1] - padded[:-2, 1:-1]) / (2 * step))


@pytest.mark.parametrize("shape", [(2, 2), (3, 7), (40, 33)])
def test_slopes_are_differences_of_the_neighbours(shape):
    heights = np.random.default_rng(0).normal(700, 5, shape).astype(np.float32)
    own, *found = with_slopes(heights, 0.6)
    np.testing.assert_array_equal(own, heights)
    np.testing.assert_allclose(found, numpys(heights, 0.6), atol=2e-4)


@pytest.mark.parametrize("shape", [(1, 1), (2, 5), (20, 17)])
def test_the_field_holds_every_second_point(shape):
    rng = np.random.default_rng(1)
    heights, detail, seeded = rng.normal(
        size=(3, 2 * shape[0], 2 * shape[1])).astype(np.float32)
    inner = rng.random(shape).astype(np.float32)
    field = mirror_planes(heights, detail, seeded, inner, 1.2)
    across, down = numpys(heights[::2, ::2], 1.2)
    facing = 1 / np.sqrt(1 + across**2 + down**2)
    expected = np.stack(
        [heights[::2, ::2], facing, inner, detail[::2, ::2] * facing, seeded[::2, ::2]], axis=-1)
    np.testing.assert_allclose(field, expected, atol=1e-5)


def test_means_fade_and_the_part_missing_of_the_full_weight_is_given():
    rng = np.random.default_rng(4)
    weight, sums = (rng.random((13, 17)).astype(np.float32) for _ in range(2))
    weight[:3] = sums[:3] = 0
    means = sums.copy()
    seeded, missing = normalize_sums(weight, means, 0.02, 0.6)
    np.testing.assert_allclose(means, sums / (weight + 0.02), rtol=1e-5)
    expected = np.minimum(weight / 0.6, 1)
    np.testing.assert_allclose(seeded, expected, rtol=1e-5)
    np.testing.assert_allclose(missing, (1 - expected) ** 2 * (1 + 2 * expected), atol=1e-6)


def test_detail_is_blended_by_the_larger_of_two_weights():
    rng = np.random.default_rng(5)
    detail, broad, near, missing = (rng.random((13, 17)).astype(np.float32) for _ in range(4))
    moved = detail.copy()
    blend_toward(moved, broad, near, missing)
    np.testing.assert_allclose(moved, detail + np.maximum(near, missing) * (broad - detail),
                               rtol=1e-5, atol=1e-6)
