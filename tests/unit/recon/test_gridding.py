"""Sums of Gaussians by way of a grid against the sums themselves."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from recon._gridding import Charges, gaussians


@settings(deadline=None, max_examples=40)
@given(n=st.integers(1, 400), seed=st.integers(0, 999), width=st.floats(0.01, 30),
       height=st.floats(0.01, 30), sharpness=st.floats(0.05, 0.82), low=st.floats(-50, 50))
def test_equals_the_sum_over_all_points(n, seed, width, height, sharpness, low):
    rng = np.random.default_rng(seed)
    x, y = low + width * rng.random(n), height * rng.random(n)
    weights = rng.normal(size=(n, 2))
    charges = Charges.of(x, y, weights)
    columns, rows = low + np.linspace(-3, width + 3, 17), np.linspace(-3, height + 3, 13)
    down, across = (gaussians(centers, points, sharpness) for centers, points in (
        (rows, charges.y), (columns, charges.x)))
    for kind in range(2):
        direct = np.einsum(
            "ri,ci,i->rc", np.exp(-sharpness * (rows[:, None] - y) ** 2),
            np.exp(-sharpness * (columns[:, None] - x) ** 2), weights[:, kind])
        np.testing.assert_allclose(
            down @ charges.shares[kind] @ across.T, direct,
            atol=4e-6 * np.abs(weights[:, kind]).sum())


def test_what_is_shared_out_adds_up():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 9, (2, 500))
    charges = Charges.of(x, y, np.column_stack([np.ones(500), x]))
    assert charges.shares.shape == (2, len(charges.y), len(charges.x))
    np.testing.assert_allclose(charges.shares.sum(axis=(1, 2)), (500, x.sum()), rtol=1e-4)
    # The centre of mass stays where it is.
    np.testing.assert_allclose((charges.shares[0] * charges.x).sum(), x.sum(), rtol=1e-4)
    np.testing.assert_allclose((charges.shares[0].T * charges.y).sum(), y.sum(), rtol=1e-4)


def test_gaussians_are_cut_off_where_they_do_not_count():
    values = gaussians(np.array([0.0, 1.0]), np.array([0.0, 2.0, 50.0]), 0.5)
    np.testing.assert_allclose(values, np.exp([[0, -2, -1250], [-0.5, -0.5, -1200]]), rtol=1e-6)
    assert not values[:, 2].any()
