"""The paper's form taken literally: W = inverse(Phi) F, Eqs. (3)-(7), one unknown for each seed.

F are the depths less their mean: a favour, since Gaussians alone make a poor constant.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, lu_factor, lu_solve

from bench.cases import Case

__all__ = ["Literal", "exact_interpolation"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Literal:
    """What became of it."""

    seeds: int
    r0_mm: float
    ridge: float
    condition: float
    """Of Phi, from its singular values; beyond 1e16 it is only a lower bound."""
    cholesky: bool
    """Phi, positive definite on paper, has a Cholesky factor in double precision."""
    at_seeds_mm: float
    """Largest difference from the seeds that it should pass through."""
    mean_mm: float
    """Mean point-to-surface error at the queries among those seeds."""
    largest_mm: float


def exact_interpolation(case: Case, count: int, ridge: float, factor: float = 6.0) -> Literal:
    """Interpolate the `count` seeds in the middle of the face, R0 = `factor` spacings.

    Parameters
    ----------
    case : the frame
    count : seeds; the system has as many unknowns, and the time grows with their cube
    ridge : added to Phi's diagonal, 0 for the paper's own form
    factor : R0 in mean spacings
    """
    seeds = case.seeds
    away = np.linalg.norm(seeds[:, :2] - np.median(seeds[:, :2], axis=0), axis=1)
    chosen = np.argsort(away)[:count]
    radius = 0.9 * away[chosen].max()
    seeds = seeds[chosen]
    middle = np.median(case.seeds[:, :2], axis=0)
    r0 = factor * case.spacing
    Phi = _gaussian(seeds[:, :2], seeds[:, :2], r0) + ridge * np.eye(len(seeds))
    singular = np.linalg.svd(Phi, compute_uv=False)
    try:
        cholesky(Phi)
        definite = True
    except LinAlgError:
        definite = False
    level = seeds[:, 2].mean()
    F = seeds[:, 2] - level
    W = lu_solve(lu_factor(Phi), F)
    inside = np.linalg.norm(case.queries - middle, axis=1) < radius
    queries = case.queries[inside][::4]
    z = level + _gaussian(queries, seeds[:, :2], r0) @ W
    errors = case.truth.surface_distance(np.column_stack([queries, z]))
    return Literal(
        seeds=len(seeds), r0_mm=r0, ridge=ridge, condition=float(singular[0] / singular[-1]),
        cholesky=definite, at_seeds_mm=float(np.abs(Phi @ W - ridge * W - F).max()),
        mean_mm=float(errors.mean()), largest_mm=float(errors.max()))


def _gaussian(a: Floats, b: Floats, r0: float) -> Floats:
    squared = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
    gaussian: Floats = np.exp(-squared / r0**2)
    return gaussian
