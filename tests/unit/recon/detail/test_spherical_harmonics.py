"""The light of a frame against NumPy."""

import numpy as np
import pytest

from denseface.recon.detail._spherical_harmonics import fit_lighting, sample_harmonics

SHAPE = 23, 31
LIGHT = np.array([0.8, 0.2, -0.3, 0.4, 0.1, -0.1, 0.05, 0.1, 0.05])


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def image(rng):
    return rng.standard_normal(SHAPE).astype(np.float32)


def basis(across, down):
    z = 1 / np.sqrt(1 + across**2 + down**2)
    x, y = across * z, down * z
    return np.stack([np.ones_like(z), x, y, z, x * x, x * y, y * y, x * z, y * z], axis=-1)


@pytest.mark.parametrize("every", [1, 3])
def test_the_light_is_told_by_some_places(rng, every):
    weight = rng.random(SHAPE).astype(np.float32)
    across, down, brightness = (image(rng) for _ in range(3))
    found, seen = sample_harmonics(brightness, weight, across, down, every)
    some = np.s_[::every, ::every]
    chosen = weight[some] > 0.5
    np.testing.assert_allclose(found.T, basis(across[some], down[some])[chosen], rtol=1e-4,
                               atol=1e-6)
    np.testing.assert_array_equal(seen, brightness[some][chosen].astype(np.float64))


def test_a_light_is_found_whatever_a_few_places_show(rng):
    terms = basis(*rng.standard_normal((2, 600)))
    seen = terms @ LIGHT
    seen[:30] *= 3
    seen[30:60] *= 0.1
    light, median = fit_lighting(np.ascontiguousarray(terms.T), seen)
    assert median == pytest.approx(np.median(seen))
    np.testing.assert_allclose((terms @ light)[60:], seen[60:], atol=0.02)
    plain = np.linalg.lstsq(terms, seen, rcond=None)[0]
    assert np.abs(terms @ light - seen)[60:].mean() < 0.2 * np.abs(terms @ plain - seen)[60:].mean()


def test_a_fit_to_all_places_alike_is_that_of_least_squares(rng):
    """Where nothing is far off, all count about alike."""
    terms = basis(*rng.standard_normal((2, 600)))
    seen = terms @ LIGHT + rng.normal(0, 1e-3, 600)
    light, _ = fit_lighting(np.ascontiguousarray(terms.T), seen)
    expected = np.linalg.lstsq(terms, seen, rcond=None)[0]
    np.testing.assert_allclose(terms @ light, terms @ expected, atol=5e-3)


@pytest.mark.parametrize(("places", "brightness"), [(49, 1.0), (200, 0.0)])
def test_too_few_or_too_dark_places_tell_no_light(rng, places, brightness):
    terms = basis(*rng.standard_normal((2, places)))
    light, median = fit_lighting(np.ascontiguousarray(terms.T), np.full(places, brightness))
    assert median == 0
    assert not light.any()
