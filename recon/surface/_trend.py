"""The quadratic polynomial beside the Gaussians: its least-squares fit, and the residuals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["Trend", "polynomial"]

_POWERS = np.array([[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]])
"""Powers of u and v in each term: 1, u, v, u^2, uv, v^2."""
_PRODUCT_POWERS = _POWERS[:, None] + _POWERS
"""Powers of u and v in the product of any two terms, (6, 6, 2)."""


@dataclass(frozen=True, eq=False)
class Trend:
    """A polynomial in u, v = ((x, y) - center) / scale, fitted to weighted points.

    Attributes
    ----------
    center : (x, y), mm
    scale : mm
    normal : (6, 6) float64, the matrix of the normal equations, P^T W P
    beta : (6,) float64, mm, before 1, u, v, u^2, uv, v^2
    residuals : (n,) float32, W_i times the residual of z_i, mm
    squares : the sum of W_i times the squared residuals, mm^2
    """

    center: tuple[float, float]
    scale: float
    normal: NDArray[np.float64]
    beta: NDArray[np.float64]
    residuals: NDArray[np.float32]
    squares: float

    @classmethod
    def of(
        cls, x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64],
        weights: NDArray[np.float64],
    ) -> "Trend":
        """Fit to points, (n,) each; u and v reach from -1 to 1."""
        cx, cy = float(x.mean()), float(y.mean())
        scale = float(max(x.max() - cx, cx - x.min(), y.max() - cy, cy - y.min()))
        sums, right = _sums(x, y, z, weights, cx, cy, 1 / scale)
        normal = sums[_PRODUCT_POWERS[..., 0], _PRODUCT_POWERS[..., 1]]
        beta: NDArray[np.float64] = np.linalg.solve(normal, right)
        residuals, squares = _residuals(x, y, z, weights, cx, cy, 1 / scale, beta)
        return cls((cx, cy), scale, normal, beta, residuals, squares)


def polynomial(
    xy: NDArray[np.floating], center: tuple[float, float], scale: float
) -> NDArray[np.float64]:
    """Give each point's 1, u, v, u^2, uv, v^2: (n, 2) to (n, 6)."""
    u, v = ((np.asarray(xy, np.float64) - center) / scale).T
    return np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])


@compiled
def _sums(
    x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64],
    weights: NDArray[np.float64], cx: float, cy: float, per_scale: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum W u^i v^j, (5, 5), 0 where i + j > 4, and W z times each term, (6,)."""
    sums, right = np.zeros((5, 5)), np.zeros(6)
    # One loop for each power of u: more sums at once than the processor has registers are slower.
    for i in range(5):
        s0 = s1 = s2 = s3 = s4 = z0 = z1 = z2 = 0.0
        for k in range(len(x)):
            u, v = (x[k] - cx) * per_scale, (y[k] - cy) * per_scale
            w = weights[k]
            if i == 1:
                w *= u
            elif i == 2:
                w *= u * u
            elif i == 3:
                w *= u * u * u
            elif i == 4:
                w *= u * u * u * u
            s0 += w
            s1 += w * v
            s2 += w * v * v
            s3 += w * v * v * v
            s4 += w * v * v * v * v
            z0 += w * z[k]
            z1 += w * v * z[k]
            z2 += w * v * v * z[k]
        for j, value in enumerate((s0, s1, s2, s3, s4)):
            if i + j < 5:
                sums[i, j] = value
        if i == 0:
            right[0], right[2], right[5] = z0, z1, z2
        elif i == 1:
            right[1], right[4] = z0, z1
        elif i == 2:
            right[3] = z0
    return sums, right


@compiled
def _residuals(
    x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64],
    weights: NDArray[np.float64], cx: float, cy: float, per_scale: float,
    beta: NDArray[np.float64],
) -> tuple[NDArray[np.float32], float]:
    """Give W times the residuals of z, and the sum of W times their squares."""
    b0, b1, b2, b3, b4, b5 = beta[0], beta[1], beta[2], beta[3], beta[4], beta[5]
    residuals = np.empty(len(x), np.float32)
    squares = 0.0
    for k in range(len(x)):
        u, v = (x[k] - cx) * per_scale, (y[k] - cy) * per_scale
        left = z[k] - (b0 + u * (b1 + b3 * u + b4 * v) + v * (b2 + b5 * v))
        residuals[k] = weights[k] * left
        squares += weights[k] * left * left
    return residuals, squares
