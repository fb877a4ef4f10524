import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.errors import TooLittleDepthError
from denseface.recon.surface import MIN_SEEDS, Surface, fit_surface
from tests.unit.recon.dense_reference import dense_heights
from tests.unit.recon.surface.evaluate import evaluated


def bumpy(n: int, seed: int, *, stretch: float = 1.0, hole: float = 0.0) -> np.ndarray:
    """Noisy seeds over a curved patch, 2 mm apart on average, (n, 3)."""
    rng = np.random.default_rng(seed)
    side = 2 * np.sqrt(n)
    xy = rng.uniform(-side / 2, side / 2, (n, 2)) * (stretch, 1 / stretch)
    xy = xy[np.hypot(*xy.T) >= hole]
    z = 700 + 8 * np.sin(xy[:, 0] / 9) + 6 * np.cos(xy[:, 1] / 7) + 0.01 * xy[:, 0] * xy[:, 1]
    return np.column_stack([xy[:, 0] + 40, xy[:, 1] - 25, z + rng.normal(0, 1, len(xy))])


def on_grid(surface: Surface, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
    xy = np.stack(np.meshgrid(xs, ys), axis=-1)
    return evaluated(surface, xy.reshape(-1, 2)).reshape(len(ys), len(xs))


@settings(deadline=None, max_examples=40)
@given(
    n=st.integers(200, 700), seed=st.integers(0, 2**32 - 1),
    factor=st.floats(4, 12), smoothing=st.floats(1, 30),
    stretch=st.floats(0.5, 2), hole=st.floats(0, 12), spread=st.floats(0, 2),
)
def test_equals_the_dense_solution(n, seed, factor, smoothing, stretch, hole, spread):
    points = bumpy(n, seed, stretch=stretch, hole=hole)
    weights = np.exp(np.random.default_rng(seed).uniform(-spread, spread, len(points)))
    surface = fit_surface(points, 2 * factor, smoothing, weights)
    rng = np.random.default_rng(seed + 1)
    queries = points[rng.integers(0, len(points), 200), :2] + rng.normal(0, 1, (200, 2))
    exact = dense_heights(points, queries, 2 * factor, smoothing, weights)
    assert np.abs(evaluated(surface, queries) - exact).max() <= 0.01


@pytest.mark.parametrize("factor", [6, 10])
def test_stays_close_to_the_dense_solution_when_hardly_smoothed(factor):
    points = bumpy(1200, 3)
    surface = fit_surface(points, 2 * factor, 0.1)
    exact = dense_heights(points, points[:, :2], 2 * factor, 0.1, np.ones(len(points)))
    assert np.abs(evaluated(surface, points[:, :2]) - exact).max() <= 0.02


def test_grid_and_scattered_evaluation_agree():
    surface = fit_surface(bumpy(600, 1), 14, 1)
    xs, ys = np.linspace(20, 60, 31), np.linspace(-40, -10, 23)
    heights, _, _ = surface.sampled(xs, ys)
    assert heights.dtype == np.float32
    np.testing.assert_allclose(heights, on_grid(surface, xs, ys), atol=1e-3)
    np.testing.assert_array_equal(surface.heights(xs, ys), heights)


def test_gradient_is_the_derivative():
    surface = fit_surface(bumpy(600, 2), 14, 1)
    xs, ys = np.linspace(30, 50, 9), np.linspace(-35, -15, 7)
    _, dx, dy = surface.sampled(xs, ys)
    e = 1e-4
    np.testing.assert_allclose(
        dx, (on_grid(surface, xs + e, ys) - on_grid(surface, xs - e, ys)) / (2 * e), atol=1e-5)
    np.testing.assert_allclose(
        dy, (on_grid(surface, xs, ys + e) - on_grid(surface, xs, ys - e)) / (2 * e), atol=1e-5)


def test_a_quadratic_comes_back_whatever_the_smoothing():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-50, 50, (2, 400))
    z = 800 + 0.3 * x - 0.2 * y + 0.004 * x * x + 0.002 * x * y - 0.003 * y * y
    surface = fit_surface(np.column_stack([x, y, z]), 15, 100)
    np.testing.assert_allclose(evaluated(surface, np.column_stack([x, y])), z, atol=1e-6)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), dx=st.floats(-500, 500), dy=st.floats(-500, 500),
       dz=st.floats(-300, 2000))
def test_moves_with_its_points(seed, dx, dy, dz):
    points = bumpy(300, seed)
    moved = np.add(points, (dx, dy, dz))
    heights = evaluated(fit_surface(points, 14, 2), points[:, :2])
    np.testing.assert_allclose(
        evaluated(fit_surface(moved, 14, 2), moved[:, :2]), heights + dz, atol=1e-3)


def test_more_weight_draws_the_surface_nearer():
    points = bumpy(500, 7)
    weights = np.ones(len(points))
    weights[0] = 1000
    points[0, 2] += 10
    free = evaluated(fit_surface(points, 14, 3), points[:1, :2])
    drawn = evaluated(fit_surface(points, 14, 3, weights), points[:1, :2])
    assert abs(drawn - points[0, 2])[0] < 0.2 * abs(free - points[0, 2])[0]


def test_too_few_seeds():
    with pytest.raises(TooLittleDepthError, match=f"{MIN_SEEDS - 1} seeds"):
        fit_surface(bumpy(MIN_SEEDS - 1, 0), 14, 1)


def test_seeds_on_a_line():
    t = np.linspace(0, 100, 200)
    with pytest.raises(TooLittleDepthError, match="line"):
        fit_surface(np.column_stack([t, 2 * t, 700 + t]), 14, 1)


@pytest.mark.parametrize(("change", "match"), [
    ({"points": np.zeros((100, 2))}, r"\(n, 3\)"),
    ({"points": np.full((100, 3), np.nan)}, "finite"),
    ({"r0": 0.0}, "r0"),
    ({"r0": np.inf}, "r0"),
    ({"smoothing": -1.0}, "smoothing"),
    ({"weights": np.zeros(300)}, "weights"),
    ({"weights": np.ones(7)}, "weights"),
])
def test_bad_arguments_are_named(change, match):
    good = {"points": bumpy(300, 0), "r0": 14.0, "smoothing": 1.0, "weights": None}
    with pytest.raises(ValueError, match=match):
        fit_surface(**{**good, **change})
