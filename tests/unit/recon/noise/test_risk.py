"""The fit of least expected error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.noise import Noise, least_risk

SPACING = 1.3


def cutoff(risk):
    """Waves longer than this pass the fit, spacings."""
    weight = math.pi * risk.r0_factor**2 / risk.smoothing
    return math.pi * risk.r0_factor / math.sqrt(math.log(weight))


def test_more_noise_is_smoothed_more():
    cutoffs = [cutoff(least_risk(Noise(0.2 + sd, 0.3 * sd, 1.5, 0), SPACING, 1.0))
               for sd in (0.2, 0.8, 3.0)]
    assert cutoffs[0] < cutoffs[1] < cutoffs[2]


def test_noise_that_is_alike_over_pixels_is_smoothed_more_than_as_much_white_noise():
    white, smooth = (least_risk(noise, SPACING, 1.0)
                     for noise in (Noise(1.0, 0, 2, 0), Noise(0, 1.0, 2, 0)))
    assert cutoff(smooth) > 1.3 * cutoff(white)
    assert smooth.error_mm > 1.5 * white.error_mm


def test_of_the_given_fits_none_is_better_than_the_one_of_least_risk():
    noise = Noise(0.5, 0.9, 1.5, 0)
    best = least_risk(noise, SPACING, 1.0)
    others = [least_risk(noise, SPACING, 1.0, r0, smoothing)
              for r0 in (6.0, 10.0, 14.0, 20.0) for smoothing in (0.3, 3.0, 12.0)]
    assert best.error_mm <= 1.01 * min(other.error_mm for other in others)


def test_what_is_given_is_kept():
    noise = Noise(0.5, 0.9, 1.5, 0)
    both = least_risk(noise, SPACING, None, 6.0, 3.0)
    assert (both.r0_factor, both.smoothing) == (6.0, 3.0)
    assert least_risk(noise, SPACING, 1.0, smoothing=8.0).smoothing == 8.0
    assert least_risk(noise, SPACING, 1.0, r0_factor=9.0).r0_factor == 9.0


def test_the_expected_error_is_that_of_the_smoother_on_such_fields():
    """A Gaussian process of the face's density, with white noise, through the filter itself."""
    noise, n = Noise(1.2, 0, 2, 0), 256
    plan = least_risk(noise, SPACING, None, 12.0, 6.0)
    rng = np.random.default_rng(0)
    k = 2 * np.pi * np.hypot(*np.meshgrid(np.fft.fftfreq(n, SPACING), np.fft.fftfreq(n, SPACING)))
    density = np.zeros_like(k)
    seen = (k > 2 * np.pi / 150) & (k < 0.9 * np.pi / SPACING)
    density[seen] = 0.035 * k[seen] ** -4.5
    face = np.fft.ifft2(np.fft.fft2(rng.standard_normal((n, n))) * np.sqrt(density) / SPACING).real
    r0 = plan.r0_factor * SPACING
    gaussian = np.pi * r0**2 * np.exp(-((k * r0) ** 2) / 4)
    passed = gaussian / (gaussian + plan.smoothing * SPACING**2)
    measured = face + rng.normal(0, 1.2, face.shape)
    fit = np.fft.ifft2(np.fft.fft2(measured) * passed).real
    assert float((fit - face).std()) == pytest.approx(plan.error_mm, rel=0.05)
    shares = plan.bias_share + plan.white_share
    assert shares == pytest.approx((fit - face).var() / (measured - fit).var(), rel=0.15)


@settings(deadline=None, max_examples=50)
@given(white=st.floats(0, 50), smooth=st.floats(0, 50), length=st.floats(0.7, 4),
       quantum=st.floats(0, 40), spacing=st.floats(0.1, 20),
       radius=st.none() | st.floats(0.5, 10))
def test_whatever_the_noise_the_numbers_are_finite(white, smooth, length, quantum, spacing, radius):
    risk = least_risk(Noise(white, smooth, length, quantum), spacing, radius)
    assert np.isfinite(risk).all()
    assert min(risk) >= 0
    assert 2 <= risk.r0_factor <= 40
    assert risk.smoothing >= 0.05
