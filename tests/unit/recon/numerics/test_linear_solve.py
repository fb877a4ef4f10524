"""A few equations, solved as NumPy solves them."""

import numpy as np

from denseface.recon.numerics.linear_solve import solve_small


def test_it_solves_what_numpy_solves():
    rng = np.random.default_rng(3)
    for size in (1, 4, 9):
        part = rng.normal(size=(size + 5, size))
        matrix, right = 100 * part.T @ part, rng.normal(size=size)
        expected = np.linalg.solve(matrix, right)
        np.testing.assert_allclose(solve_small(matrix, right), expected, rtol=1e-5)


def test_the_solution_of_a_singular_system_is_finite():
    assert np.isfinite(solve_small(np.zeros((3, 3)), np.zeros(3))).all()
