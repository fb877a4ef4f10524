"""The quadratic polynomial beside the Gaussians: its least-squares fit, and the residuals."""

from dataclasses import dataclass

import numpy as np

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.numerics.jit import compiled

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
    """

    center: tuple[float, float]
    scale: float
    normal: Doubles
    beta: Doubles
    residuals: Floats

    @classmethod
    def of(cls, x: Doubles, y: Doubles, z: Doubles, weights: Doubles) -> "Trend":
        """Fit to points, (n,) each; u and v reach from -1 to 1."""
        cx, cy = float(x.mean()), float(y.mean())
        scale = float(max(x.max() - cx, cx - x.min(), y.max() - cy, cy - y.min()))
        sums, right = _sums(x, y, z, weights, cx, cy, 1 / scale)
        normal = sums[_PRODUCT_POWERS[..., 0], _PRODUCT_POWERS[..., 1]]
        beta: Doubles = np.linalg.solve(normal, right[_POWERS[:, 0], _POWERS[:, 1]])
        return cls((cx, cy), scale, normal, beta,
                   _residuals(x, y, z, weights, cx, cy, 1 / scale, beta))


@compiled
def _sums(
    x: Doubles, y: Doubles, z: Doubles, weights: Doubles, cx: float, cy: float, per_scale: float
) -> tuple[Doubles, Doubles]:
    """Sum W u^i v^j, (5, 5), and W z u^i v^j, (5, 3)."""
    sums, right = np.empty((5, 5)), np.empty((5, 3))
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
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3], sums[i, 4] = s0, s1, s2, s3, s4
        right[i, 0], right[i, 1], right[i, 2] = z0, z1, z2
    return sums, right


@compiled
def _residuals(
    x: Doubles, y: Doubles, z: Doubles, weights: Doubles, cx: float, cy: float, per_scale: float,
    beta: Doubles,
) -> Floats:
    """Give W times the residuals of z."""
    b0, b1, b2, b3, b4, b5 = beta[0], beta[1], beta[2], beta[3], beta[4], beta[5]
    residuals = np.empty(len(x), np.float32)
    for k in range(len(x)):
        u, v = (x[k] - cx) * per_scale, (y[k] - cy) * per_scale
        left = z[k] - (b0 + u * (b1 + b3 * u + b4 * v) + v * (b2 + b5 * v))
        residuals[k] = weights[k] * left
    return residuals
