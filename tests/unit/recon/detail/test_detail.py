"""Detail comes back where there is something to see; elsewhere the broad fit stays."""

import numpy as np
import pytest

from denseface.recon.surface import fit_surface
from tests.unit.recon.shapes import disc_seeds, with_detail

SPACING = 1.3
XS = YS = np.linspace(-45, 45, 61)
X, Y = np.meshgrid(XS, YS)
AWAY = np.hypot(X - 12, Y + 8)
INSIDE = np.hypot(X, Y) < 50


def truth(x, y):
    """Flat but for one sharp bump, mm."""
    return 700 + 5 * np.exp(-((x - 12) ** 2 + (y + 8) ** 2) / (2 * 4.0**2))


def surfaces(noise_mm, shape=truth, hole=0.0):
    points = disc_seeds(SPACING, 55, hole)
    points[:, 2] = shape(*points[:, :2].T) + np.random.default_rng(3).normal(
        0, noise_mm, len(points))
    broad = fit_surface(points, 14 * SPACING, 20)
    return broad, with_detail(broad, points, SPACING, 1.6 * SPACING)


@pytest.fixture(scope="module")
def noisy():
    return surfaces(1.2)


def rms(heights, where, shape=truth):
    return float(np.sqrt(((heights - shape(X, Y))[where] ** 2).mean()))


def test_nearly_nothing_where_flat_and_noisy(noisy):
    broad, detailed = (one.sampled(XS, YS)[0] for one in noisy)
    flat = (AWAY > 25) & INSIDE
    assert rms(detailed, flat) < 1.5 * rms(broad, flat)
    assert rms(detailed, flat) < 0.2


def test_the_bump_comes_back(noisy):
    broad, detailed = (one.sampled(XS, YS)[0] for one in noisy)
    bump = AWAY < 8
    assert rms(broad, bump) > 3 * rms(detailed, bump)


def test_better_than_either_smoothing_for_the_whole(noisy):
    broad, detailed = noisy
    points = disc_seeds(SPACING, 55)
    points[:, 2] = truth(*points[:, :2].T) + np.random.default_rng(3).normal(0, 1.2, len(points))
    fine = fit_surface(points, 6 * SPACING, 1)
    best = min(rms(one.sampled(XS, YS)[0], INSIDE) for one in (broad, fine))
    assert rms(detailed.sampled(XS, YS)[0], INSIDE) < 0.8 * best


def test_the_gradient_is_the_derivative(noisy):
    _, detailed = noisy
    e = 0.3
    heights, dx, dy = detailed.sampled(XS, YS)
    np.testing.assert_allclose(heights, detailed.sampled(XS, YS)[0], atol=1e-3)
    for slope, moved in (
            (dx, (detailed.sampled(XS + e, YS)[0] - detailed.sampled(XS - e, YS)[0]) / (2 * e)),
            (dy, (detailed.sampled(XS, YS + e)[0] - detailed.sampled(XS, YS - e)[0]) / (2 * e))):
        assert np.abs(slope - moved)[INSIDE].max() < 0.05
        assert np.corrcoef(slope[INSIDE], moved[INSIDE])[0, 1] > 0.995


def test_without_noise_the_surface_is_that_of_the_seeds():
    _, detailed = surfaces(0.0)
    assert rms(detailed.sampled(XS, YS)[0], AWAY < 8) < 0.4
    assert rms(detailed.sampled(XS, YS)[0], (AWAY > 25) & INSIDE) < 0.02


def test_inside_a_hole_the_surface_goes_on_from_its_border():
    def hill(x, y):
        return 700 + 4 * np.exp(-(x * x + y * y) / (2 * 8.0**2))

    hole = np.hypot(X, Y) < 6
    broad, detailed = (one.sampled(XS, YS)[0] for one in surfaces(0.0, hill, hole=6.0))
    assert rms(detailed, hole, hill) < 0.45 * rms(broad, hole, hill)
    whole = surfaces(0.0, hill)[1].sampled(XS, YS)[0]
    far = (np.hypot(X, Y) > 15) & (np.hypot(X, Y) < 45)
    np.testing.assert_allclose(detailed[far], whole[far], atol=0.02)


def test_the_same_seeds_give_the_same_bytes(noisy):
    again = surfaces(1.2)[1]
    np.testing.assert_array_equal(noisy[1].values, again.values)


def test_far_from_all_seeds_the_detail_stays_finite():
    """Of the bump nothing is seen: the seeds lie in a plane, which goes on."""
    points = disc_seeds(SPACING, 55, 40)
    points[:, 2] = truth(*points[:, :2].T)
    broad = fit_surface(points, 14 * SPACING, 20)
    detailed = with_detail(broad, points, SPACING, 1.6 * SPACING)
    assert np.isfinite(detailed.values).all()
    middle = np.hypot(X, Y) < 20
    np.testing.assert_allclose(detailed.sampled(XS, YS)[0][middle], 700, atol=0.02)
