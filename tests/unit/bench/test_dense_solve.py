import numpy as np

from bench.dense_solve import dense_heights
from denseface.recon.surface import fit_surface
from tests.unit.recon.surface.evaluate import evaluated


def test_is_the_system_that_the_fast_fit_solves():
    rng = np.random.default_rng(5)
    xy = rng.uniform(-30, 30, (400, 2))
    points = np.column_stack([xy, 700 + 5 * np.sin(xy[:, 0] / 9) + rng.normal(0, 1, 400)])
    queries = rng.uniform(-25, 25, (50, 2))
    fast = evaluated(fit_surface(points, 18.0, 3.0), queries)
    assert np.abs(dense_heights(points, queries, 18.0, 3.0) - fast).max() < 0.01
