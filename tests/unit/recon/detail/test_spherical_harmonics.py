"""The lighting of a frame against NumPy."""

import numpy as np
import pytest

from denseface.recon.detail._spherical_harmonics import fit_lighting, sample_harmonics

SHAPE = 23, 31
LIGHTING = np.array([0.8, 0.2, -0.3, 0.4, 0.1, -0.1, 0.05, 0.1, 0.05])


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def image(rng):
    return rng.standard_normal(SHAPE).astype(np.float32)


def basis(dz_dx, dz_dy):
    z = 1 / np.sqrt(1 + dz_dx**2 + dz_dy**2)
    x, y = dz_dx * z, dz_dy * z
    return np.stack([np.ones_like(z), x, y, z, x * x, x * y, y * y, x * z, y * z], axis=-1)


@pytest.mark.parametrize("every", [1, 3])
def test_harmonics_are_those_of_the_sampled_normals(rng, every):
    weight = rng.random(SHAPE).astype(np.float32)
    dz_dx, dz_dy, brightness = (image(rng) for _ in range(3))
    found, samples = sample_harmonics(brightness, weight, dz_dx, dz_dy, every)
    some = np.s_[::every, ::every]
    chosen = weight[some] > 0.5
    np.testing.assert_allclose(found.T, basis(dz_dx[some], dz_dy[some])[chosen], rtol=1e-4,
                               atol=1e-6)
    np.testing.assert_array_equal(samples, brightness[some][chosen].astype(np.float64))


def test_a_lighting_is_fitted_whatever_a_few_samples_show(rng):
    terms = basis(*rng.standard_normal((2, 600)))
    samples = terms @ LIGHTING
    samples[:30] *= 3
    samples[30:60] *= 0.1
    lighting, median = fit_lighting(np.ascontiguousarray(terms.T), samples)
    assert median == pytest.approx(np.median(samples))
    np.testing.assert_allclose((terms @ lighting)[60:], samples[60:], atol=0.02)
    plain = np.linalg.lstsq(terms, samples, rcond=None)[0]
    robust_error, plain_error = (
        np.abs(terms @ one - samples)[60:].mean() for one in (lighting, plain))
    assert robust_error < 0.2 * plain_error


def test_without_outliers_the_fit_is_that_of_least_squares(rng):
    """Where nothing is far off, all count about alike."""
    terms = basis(*rng.standard_normal((2, 600)))
    samples = terms @ LIGHTING + rng.normal(0, 1e-3, 600)
    lighting, _ = fit_lighting(np.ascontiguousarray(terms.T), samples)
    expected = np.linalg.lstsq(terms, samples, rcond=None)[0]
    np.testing.assert_allclose(terms @ lighting, terms @ expected, atol=5e-3)


@pytest.mark.parametrize(("count", "brightness"), [(49, 1.0), (200, 0.0)])
def test_too_few_or_too_dark_samples_tell_no_lighting(rng, count, brightness):
    terms = basis(*rng.standard_normal((2, count)))
    lighting, median = fit_lighting(np.ascontiguousarray(terms.T), np.full(count, brightness))
    assert median == 0
    assert not lighting.any()
