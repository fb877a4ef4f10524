"""The quadratic polynomial beside the Gaussians: its least-squares fit, and what it leaves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Trend", "polynomial"]

# Powers of u and v in each term: 1, u, v, u^2, uv, v^2.
_POWERS = np.array([[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]])


@dataclass(frozen=True, eq=False)
class Trend:
    """A polynomial in u, v = ((x, y) - center) / scale, fitted to weighted points.

    Attributes
    ----------
    center : (x, y), mm
    scale : mm
    normal : (6, 6) float64, the matrix of the normal equations, P^T W P
    beta : (6,) float64, mm, before 1, u, v, u^2, uv, v^2
    rest : (n,) float32, W_i times what is left of z_i, mm
    squares : the sum of W_i times the square of what is left
    """

    center: tuple[float, float]
    scale: float
    normal: NDArray[np.float64]
    beta: NDArray[np.float64]
    rest: NDArray[np.float32]
    squares: float

    @classmethod
    def of(
        cls, x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64],
        weights: NDArray[np.float64],
    ) -> "Trend":
        """Fit to points, (n,) each; u and v reach from -1 to 1."""
        cx, cy = float(x.mean()), float(y.mean())
        scale = float(max(x.max() - cx, cx - x.min(), y.max() - cy, cy - y.min()))
        u, v = (x - cx) / scale, (y - cy) / scale
        # All sums of W u^i v^j at once.
        by_u = weights * np.stack([np.ones_like(u), u, u * u, u * u * u, (u * u) ** 2])
        by_v = np.stack([np.ones_like(v), v, v * v, v * v * v, (v * v) ** 2])
        powers = _POWERS[:, None] + _POWERS
        normal = (by_u @ by_v.T)[powers[..., 0], powers[..., 1]]
        right = (by_u[:3] @ (by_v[:3] * z).T)[_POWERS[:, 0], _POWERS[:, 1]]
        beta: NDArray[np.float64] = np.linalg.solve(normal, right)
        b = beta.tolist()
        left = z - (b[0] + u * (b[1] + b[3] * u + b[4] * v) + v * (b[2] + b[5] * v))
        rest = weights * left
        return cls((cx, cy), scale, normal, beta, rest.astype(np.float32), float(rest @ left))


def polynomial(
    xy: NDArray[np.floating], center: tuple[float, float], scale: float
) -> NDArray[np.float64]:
    """Give each point's 1, u, v, u^2, uv, v^2: (n, 2) to (n, 6)."""
    u, v = ((np.asarray(xy, np.float64) - center) / scale).T
    return np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
