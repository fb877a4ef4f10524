"""The fast solver at the edge of what it is for: few seeds, thin bands, uneven sampling, turns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.errors import TooLittleDepthError
from denseface.recon.surface import MIN_SEEDS, fit_surface
from tests.unit.recon.dense_reference import dense_heights
from tests.unit.recon.surface.evaluate import evaluated

SEEDS = st.integers(0, 2**32 - 1)


def waves(xy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noisy heights over (n, 2) places, (n, 3)."""
    z = 700 + 8 * np.sin(xy[:, 0] / 9) + 6 * np.cos(xy[:, 1] / 7)
    return np.column_stack([xy, z + rng.normal(0, 1, len(xy))])


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """The points turned about the viewing axis; (n, 2) or (n, 3)."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    out = points.copy()
    out[:, :2] = points[:, :2] @ np.array([[c, s], [-s, c]])
    return out


def deviation(points: np.ndarray, r0: float, smoothing: float, weights: np.ndarray) -> float:
    """Largest difference from the dense solution, at the seeds and between them, mm."""
    between = (points[:-1, :2] + points[1:, :2]) / 2
    near = np.hypot(*(points[:-1, :2] - points[1:, :2]).T) < r0
    queries = np.concatenate([points[:, :2], between[near]])
    exact = dense_heights(points, queries, r0, smoothing, weights)
    surface = fit_surface(points, r0, smoothing, weights)
    return float(np.abs(evaluated(surface, queries) - exact).max())


@settings(deadline=None, max_examples=30)
@given(n=st.integers(MIN_SEEDS, 120), seed=SEEDS, r0=st.floats(4, 40),
       smoothing=st.floats(0.5, 100))
def test_few_seeds_equal_the_dense_solution(n, seed, r0, smoothing):
    rng = np.random.default_rng(seed)
    points = waves(rng.uniform(-20, 20, (n, 2)), rng)
    assert deviation(points, r0, smoothing, np.ones(n)) <= 0.01


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS, thin=st.floats(1, 8), degrees=st.floats(0, 180), smoothing=st.floats(0.5, 30),
       holes=st.integers(0, 3), spread=st.floats(0, 3))
def test_uneven_sampling_equals_the_dense_solution(
    seed, thin, degrees, smoothing, holes, spread
):
    """Up to eight times denser along one direction, as on a surface seen aslant, with holes."""
    rng = np.random.default_rng(seed)
    across, down = np.meshgrid(np.arange(-20, 20, 2 / np.sqrt(thin)),
                               np.arange(-20, 20, 2 * np.sqrt(thin)))
    xy = np.column_stack([across.ravel(), down.ravel()])
    xy = turned(xy + rng.normal(0, 0.1, xy.shape), degrees)
    for center in rng.uniform(-12, 12, (holes, 2)):
        xy = xy[np.hypot(*(xy - center).T) > 5]
    weights = np.exp(rng.uniform(-spread, spread, len(xy)))
    assert deviation(waves(xy, rng), 14, smoothing, weights) <= 0.01


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS, degrees=st.sampled_from([90.0, 180.0, 270.0]) | st.floats(-180, 180),
       smoothing=st.floats(0.5, 30))
def test_a_turn_about_the_viewing_axis_turns_the_surface(seed, degrees, smoothing):
    rng = np.random.default_rng(seed)
    points = waves(rng.uniform(-25, 25, (500, 2)), rng)
    there = turned(points, degrees)
    heights = evaluated(fit_surface(points, 14, smoothing), points[:, :2])
    np.testing.assert_allclose(
        evaluated(fit_surface(there, 14, smoothing), there[:, :2]), heights, atol=0.02)


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS, n=st.integers(MIN_SEEDS, 400), degrees=st.floats(0, 180),
       length=st.floats(1, 300), far=st.floats(-1000, 1000))
def test_seeds_on_any_line_are_named(seed, n, degrees, length, far):
    rng = np.random.default_rng(seed)
    line = np.column_stack([rng.uniform(-length, length, n), np.zeros(n)])
    points = waves(turned(line, degrees) + far, rng)
    with pytest.raises(TooLittleDepthError, match="line"):
        fit_surface(points, 14, 1)


def test_seeds_on_one_spot_are_named():
    points = np.tile(np.array([[3.0, 4.0, 700.0]]), (100, 1))
    with pytest.raises(TooLittleDepthError):
        fit_surface(points, 14, 1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("where", "match"), [("points", "points"), ("weights", "weights")])
def test_one_value_that_is_no_number_is_named(where, match, bad):
    rng = np.random.default_rng(0)
    given = {"points": waves(rng.uniform(-20, 20, (300, 2)), rng), "weights": np.ones(300)}
    given[where].flat[137] = bad
    with pytest.raises(ValueError, match=match):
        fit_surface(given["points"], 14, 1, given["weights"])
