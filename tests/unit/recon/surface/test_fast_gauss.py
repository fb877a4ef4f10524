"""Sums of Gaussians by way of a grid against the sums themselves."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.surface._fast_gauss import FastGaussTransform


def direct(rows, columns, x, y, weights, b):
    return np.einsum("ri,ci,i->rc", np.exp(-b * (rows[:, None] - y) ** 2),
                     np.exp(-b * (columns[:, None] - x) ** 2), weights)


@settings(deadline=None, max_examples=40)
@given(n=st.integers(1, 400), seed=st.integers(0, 999), width=st.floats(0, 30),
       height=st.floats(0.01, 30), sharpest=st.floats(0.05, 5), part=st.floats(0.05, 1),
       low=st.floats(-50, 50))
def test_equals_the_sum_over_all_points(n, seed, width, height, sharpest, part, low):
    rng = np.random.default_rng(seed)
    x, y = low + width * rng.random(n), height * rng.random(n)
    weights = rng.normal(size=(2, n))
    transform = FastGaussTransform.of(x, y, (weights[0], weights[1]), sharpest)
    columns, rows = low + np.linspace(-3, width + 3, 17), np.linspace(-3, height + 3, 13)
    b = part * sharpest
    factors_y = transform.factors(transform.y, rows, b)
    factors_x = transform.factors(transform.x, columns, b)
    for kind in range(2):
        np.testing.assert_allclose(
            factors_y @ transform.weights(kind) @ factors_x.T,
            direct(rows, columns, x, y, weights[kind], b),
            atol=5e-6 * np.abs(weights[kind]).sum())


def test_moments_weigh_by_powers_of_the_coordinate():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(20, 60, 500), rng.uniform(-30, 30, 500)
    u, v = (x - 40) / 30, (y - 2) / 30
    transform = FastGaussTransform.of(x, y, (np.ones(500), u), 0.2)
    columns, rows, b = np.linspace(15, 65, 11), np.linspace(-35, 35, 12), 0.07
    factors_x = transform.moment_factors(transform.x, columns, b, 40, 30)
    factors_y = transform.moment_factors(transform.y, rows, b, 2, 30)
    for i in range(3):
        for j in range(3):
            np.testing.assert_allclose(
                factors_y[j] @ transform.weights(0) @ factors_x[i].T,
                direct(rows, columns, x, y, u**i * v**j, b), atol=1e-4)
