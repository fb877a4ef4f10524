"""The blend takes the fine fit where there is something to see, else the coarse one."""

import numpy as np
import pytest

from recon.adapt import blend_surfaces
from recon.rbf import fit_surface
from tests.unit.recon.shapes import disc_seeds

SPACING = 1.3
XS = YS = np.linspace(-45, 45, 61)
X, Y = np.meshgrid(XS, YS)
AWAY = np.hypot(X - 12, Y + 8)


def truth(x, y):
    """Flat but for one sharp bump, mm."""
    return 700 + 5 * np.exp(-((x - 12) ** 2 + (y + 8) ** 2) / (2 * 4.0**2))


def surfaces(noise_mm):
    points = disc_seeds(SPACING, 55)
    points[:, 2] = truth(*points[:, :2].T) + np.random.default_rng(3).normal(
        0, noise_mm, len(points))
    fine = fit_surface(points, 6 * SPACING, 1)
    coarse = fit_surface(points, 14 * SPACING, 20)
    return fine, coarse, blend_surfaces(fine, coarse, points, SPACING)


@pytest.fixture(scope="module")
def noisy():
    return surfaces(1.2)


def rms(heights, where):
    return float(np.sqrt(((heights - truth(X, Y))[where] ** 2).mean()))


def test_coarse_where_flat_and_noisy(noisy):
    fine, coarse, blend = (one.on_grid(XS, YS) for one in noisy)
    flat = (AWAY > 25) & (np.hypot(X, Y) < 50)
    assert rms(blend, flat) < 0.75 * rms(fine, flat)
    assert rms(blend, flat) < 2 * rms(coarse, flat)


def test_fine_where_a_bump_is(noisy):
    fine, coarse, blend = (one.on_grid(XS, YS) for one in noisy)
    bump = AWAY < 8
    assert rms(coarse, bump) > 2 * rms(fine, bump)
    assert rms(blend, bump) < 1.2 * rms(fine, bump)


def test_better_than_either_on_the_whole(noisy):
    inside = np.hypot(X, Y) < 50
    fine, coarse, blend = (rms(one.on_grid(XS, YS), inside) for one in noisy)
    assert blend < 0.8 * min(fine, coarse)


def test_always_between_the_two(noisy):
    fine, coarse, blend = (one.on_grid(XS, YS) for one in noisy)
    assert (blend >= np.minimum(fine, coarse) - 1e-9).all()
    assert (blend <= np.maximum(fine, coarse) + 1e-9).all()
    gain = noisy[2].gain
    assert gain.dtype == np.float32
    assert gain.min() >= 0
    assert gain.max() <= 1


def test_the_gradient_is_nearly_the_derivative(noisy):
    blend = noisy[2]
    e = 1e-3
    heights, dx, dy = blend.sampled(XS, YS)
    np.testing.assert_allclose(heights, blend.on_grid(XS, YS), atol=1e-3)
    inside = np.hypot(X, Y) < 50
    for slope, moved in (
            (dx, (blend.on_grid(XS + e, YS) - blend.on_grid(XS - e, YS)) / (2 * e)),
            (dy, (blend.on_grid(XS, YS + e) - blend.on_grid(XS, YS - e)) / (2 * e))):
        # The gain's own slope is left out.
        assert np.sqrt(((slope - moved)[inside] ** 2).mean()) < 0.03
        assert np.corrcoef(slope[inside], moved[inside])[0, 1] > 0.92


def test_noise_is_that_of_the_fine_fit(noisy):
    fine, _, blend = noisy
    assert blend.noise == fine.noise
    assert blend.noise == pytest.approx(1.2, rel=0.1)


def test_without_noise_the_bump_is_kept():
    fine, _, blend = surfaces(0.0)
    bump = AWAY < 8
    np.testing.assert_allclose(
        blend.on_grid(XS, YS)[bump], fine.on_grid(XS, YS)[bump], atol=0.05)
