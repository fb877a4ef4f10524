"""The very system that `recon.surface._rbf` solves, with one unknown for each seed, by LAPACK."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["dense_heights"]

Floats = NDArray[np.float64]
_CHUNK = 4000


def dense_heights(points: Floats, queries: Floats, r0: float, smoothing: float) -> Floats:
    """Solve (Phi + lambda I) w + P beta = z, P^T w = 0 and evaluate.

    Parameters
    ----------
    points : (n, 3) float64, mm
    queries : (m, 2) float64, mm
    r0 : the Gaussian's radius, mm
    smoothing : lambda

    Returns
    -------
    (m,) float64, mm
    """
    center = points[:, :2].mean(axis=0)
    scale = np.abs(points[:, :2] - center).max()
    P = _polynomial((points[:, :2] - center) / scale)
    n, p = P.shape
    system = np.zeros((n + p, n + p))
    system[:n, :n] = _gaussian(points[:, :2], points[:, :2], r0)
    system[np.arange(n), np.arange(n)] += smoothing
    system[:n, n:], system[n:, :n] = P, P.T
    solved = np.linalg.solve(system, np.concatenate([points[:, 2], np.zeros(p)]))
    heights = [_gaussian(part, points[:, :2], r0) @ solved[:n]
               + _polynomial((part - center) / scale) @ solved[n:]
               for part in np.array_split(queries, -(-len(queries) // _CHUNK))]
    return np.concatenate(heights)


def _gaussian(a: Floats, b: Floats, r0: float) -> Floats:
    squared = (a[:, :1] - b[:, 0]) ** 2 + (a[:, 1:] - b[:, 1]) ** 2
    gaussian: Floats = np.exp(squared / -(r0 * r0))
    return gaussian


def _polynomial(uv: Floats) -> Floats:
    u, v = uv.T
    return np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
