"""The noise of a frame, told by its seeds alone."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.noise import Noise, measure_noise

SPACING = 1.3
ROWS, COLUMNS = 150, 110


def seeds(noise, quantum=0.0, keep=1.0, seed=0):
    """A head-like ellipsoid with a nose, seen with some noise: points and pixels."""
    v, u = np.mgrid[:ROWS, :COLUMNS]
    x, y = (u - COLUMNS / 2) * SPACING, (v - ROWS / 2) * SPACING
    z = 800 - 60 * np.sqrt(np.maximum(1 - (x / 90) ** 2 - (y / 120) ** 2, 0.05))
    z -= 18 * np.exp(-(x**2 + (y / 1.6) ** 2) / (2 * 10.0**2))
    z = z + noise
    if quantum:
        z = np.rint(z / quantum) * quantum
    kept = np.random.default_rng(seed).random(z.shape) < keep
    points = np.stack([x[kept], y[kept], z[kept]], axis=1).astype(np.float32)
    return points, np.stack([v[kept], u[kept]], axis=1).astype(np.int32)


def field(sd, length, seed=1):
    """Noise of a standard deviation, alike over some pixels."""
    white = np.random.default_rng(seed).standard_normal((ROWS, COLUMNS))
    if not length:
        return sd * white
    smooth = cv2.GaussianBlur(white, (0, 0), length)
    return sd * smooth / smooth.std()


@pytest.mark.parametrize("sd", [0.6, 1.2, 2.4])
def test_white_noise(sd):
    found = measure_noise(*seeds(field(sd, 0)), SPACING)
    assert found.white_mm == pytest.approx(sd, rel=0.1)
    assert found.smooth_mm < 0.5 * sd
    assert found.correlation_px < 0.8


@pytest.mark.parametrize(("sd", "length"), [(0.8, 1.0), (1.5, 1.5), (2.5, 2.5)])
def test_smooth_noise(sd, length):
    found = measure_noise(*seeds(field(sd, length)), SPACING)
    assert found.white_mm < 0.25 * sd
    assert found.total_mm == pytest.approx(sd, rel=0.35)
    assert found.correlation_px == pytest.approx(length, rel=0.4)


def test_both():
    found = measure_noise(*seeds(field(1.0, 0) + field(1.5, 2.0, seed=2)), SPACING)
    assert found.white_mm == pytest.approx(1.0, rel=0.2)
    assert found.smooth_mm == pytest.approx(1.5, rel=0.35)


@pytest.mark.parametrize("quantum", [0.1, 1.0, 3.0, 10.0])
def test_the_levels_of_depth(quantum):
    found = measure_noise(*seeds(field(0.5, 0), quantum), SPACING)
    assert found.quantum_mm == pytest.approx(quantum, rel=0.1)
    assert found.total_mm >= quantum / np.sqrt(12) - 1e-6


def test_levels_leave_an_error_that_noise_takes_away():
    coarse, fine = (measure_noise(*seeds(field(0.3, 0), quantum), SPACING)
                    for quantum in (6.0, 0.5))
    # 1.35 mm without any noise; the terraces of a slope look like some.
    assert 0.25 < coarse.level_error_mm < 1.36
    assert fine.level_error_mm < 0.01


def test_a_face_alone_is_hardly_noise():
    assert measure_noise(*seeds(np.zeros((ROWS, COLUMNS))), SPACING).total_mm < 0.12


def test_missing_seeds_change_little():
    whole, part = (measure_noise(*seeds(field(1.2, 0), keep=keep), SPACING) for keep in (1.0, 0.7))
    assert part.white_mm == pytest.approx(whole.white_mm, rel=0.1)


@settings(deadline=None, max_examples=20)
@given(count=st.integers(2, 300), seed=st.integers(0, 99), spread=st.floats(0, 50))
def test_any_few_seeds_give_a_finite_answer(count, seed, spread):
    rng = np.random.default_rng(seed)
    pixels = np.unique(rng.integers(0, 40, (count, 2)), axis=0).astype(np.int32)
    z = 700 + rng.normal(0, spread, len(pixels)) if spread else np.full(len(pixels), 700.0)
    points = np.column_stack([pixels[:, 1] * 1.2, pixels[:, 0] * 1.2, z]).astype(np.float32)
    found = measure_noise(points, pixels, 1.2)
    values = [found.white_mm, found.smooth_mm, found.length_px, found.quantum_mm,
              found.level_error_mm, found.correlation_px]
    assert np.isfinite(values).all()
    assert min(values) >= 0


@pytest.mark.parametrize(("length", "side"), [(0, 2), (0, 3), (1.5, 2), (2.5, 3)])
def test_what_means_of_squares_leave_of_it(length, side):
    """Of a large field, whose means are taken: variance, and the density of long waves."""
    rng = np.random.default_rng(5)
    one = rng.standard_normal((600, 600))
    if length:
        one = cv2.GaussianBlur(one, (0, 0), length)
    one /= one.std()
    known = Noise(0.0, 1.0, length, 0.1) if length else Noise(1.0, 0.0, 2.0, 0.1)
    left = known.averaged(side)
    means = one.reshape(600 // side, side, 600 // side, side).mean(axis=(1, 3))
    assert left.total_mm == pytest.approx(means.std(), rel=0.06)
    assert left.quantum_mm == known.quantum_mm
    if length:
        long = cv2.GaussianBlur(means, (0, 0), 6).std()
        again = rng.standard_normal(means.shape)
        same = cv2.GaussianBlur(again, (0, 0), left.length_px)
        same *= left.smooth_mm / same.std()
        assert cv2.GaussianBlur(same, (0, 0), 6).std() == pytest.approx(long, rel=0.15)
