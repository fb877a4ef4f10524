r"""Stage 5: Gaussian radial basis functions over (X, Y), Eqs. (3)-(7), in a well-posed form.

The paper's exact interpolation, W = inverse(Phi) F, cannot be computed: with R0 = 6 spacings the
condition number of Phi is near 1e21, and it would reproduce the noise. Solved here is its
smoothing form with a quadratic polynomial p,

    minimise  sum_i W_i (z_i - f(x_i))^2 + lambda |f|^2,    f = sum_i w_i phi(|x - x_i|) + p(x),

phi(r) = exp(-r^2 / R0^2). A Gaussian is, to about 4 exp(-pi^2 / (4 q^2)), the product of narrower
ones over a regular grid of nodes t with step q R0:

    phi(|x - c|) = c0 sum_t g(x - t) g(t - c),   g(r) = exp(-2 r^2 / R0^2),   c0 = 4 q^2 / pi,

so Phi = A A^T with A = sqrt(c0) g(x_i - t), and instead of one unknown for each seed there is one
for each node: (A^T W A + lambda I) alpha = A^T W (z - p). The matrix is banded, and needs no
loop over pairs:  g(x - t) g(x - t') = exp(-|t - t'|^2 / R0^2) exp(-4 |x - (t + t')/2|^2 / R0^2).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon._kernels import CHANNELS, conjugate_gradients, spread, spread_density
from recon.errors import TooLittleDepthError

__all__ = ["MIN_SEEDS", "Surface", "fit_surface"]

MIN_SEEDS = 50
"""Fewer seeds than this are no face, and leave the polynomial without support."""

_NODE_STEP = 0.45
_NODE_STEP_SHARP = 0.40
_SHARP_BELOW = 0.3
_NEGLIGIBLE = 1e-5
# Of the preconditioned residual.
_TOLERANCE = 1e-6
_MOST_ITERATIONS = 1000
# Below this ratio of the principal extents, the seeds lie on a line.
_COLLINEAR = 1e-3


@dataclass(frozen=True, eq=False)
class Surface:
    """The fitted height z = f(x, y), mm, over (X, Y) of the depth camera's frame.

    Attributes
    ----------
    nodes_x, nodes_y : (nx,), (ny,) float64, mm, the node grid
    alpha : (ny, nx) float64, node weights
    beta : (6,) float64, the polynomial in ((x, y) - center) / scale: 1, x, y, x^2, xy, y^2
    center : (x, y), mm
    scale : mm
    r0 : mm
    noise : weighted standard deviation of the seeds about the surface, mm
    """

    nodes_x: NDArray[np.float64]
    nodes_y: NDArray[np.float64]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    center: tuple[float, float]
    scale: float
    r0: float
    noise: float

    def on_grid(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate on an axis-aligned grid: two thin matrix products.

        Parameters
        ----------
        xs, ys : (k,), (m,) float64, mm

        Returns
        -------
        (m, k) float64, mm
        """
        ey, ex = _basis(ys, self.nodes_y, self.r0), _basis(xs, self.nodes_x, self.r0)
        u, v = self._normalised(xs, ys)
        b = self.beta
        heights: NDArray[np.float64] = (ey @ self.alpha) @ ex.T
        heights += b[0] + b[1] * u + b[3] * u * u
        heights += (b[2] * v + b[5] * v * v)[:, None] + b[4] * np.outer(v, u)
        return heights

    def gradient_on_grid(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Differentiate the surface on an axis-aligned grid: (df/dx, df/dy), each (m, k)."""
        ey, ex = _basis(ys, self.nodes_y, self.r0), _basis(xs, self.nodes_x, self.r0)
        along_x = (ey @ self.alpha) @ _slope(ex, xs, self.nodes_x, self.r0).T
        along_y = _slope(ey, ys, self.nodes_y, self.r0) @ (self.alpha @ ex.T)
        u, v = self._normalised(xs, ys)
        b = self.beta
        return (along_x + (b[1] + 2 * b[3] * u + b[4] * v[:, None]) / self.scale,
                along_y + ((b[2] + 2 * b[5] * v)[:, None] + b[4] * u) / self.scale)

    def at(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Evaluate at scattered points: (n, 2) mm -> (n,) mm."""
        ex = _basis(xy[:, 0], self.nodes_x, self.r0)
        ey = _basis(xy[:, 1], self.nodes_y, self.r0)
        heights: NDArray[np.float64] = np.einsum("ij,ij->i", ey @ self.alpha, ex)
        return heights + _polynomial(xy, self.center, self.scale) @ self.beta

    def slope_at(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Give the steepness |grad f| at scattered points: (n, 2) mm -> (n,), unitless."""
        ex = _basis(xy[:, 0], self.nodes_x, self.r0)
        ey = _basis(xy[:, 1], self.nodes_y, self.r0)
        dx = np.einsum("ij,ij->i", ey @ self.alpha, _slope(ex, xy[:, 0], self.nodes_x, self.r0))
        dy = np.einsum("ij,ij->i", _slope(ey, xy[:, 1], self.nodes_y, self.r0) @ self.alpha, ex)
        u = (xy[:, 0] - self.center[0]) / self.scale
        v = (xy[:, 1] - self.center[1]) / self.scale
        b = self.beta
        dx = dx + (b[1] + 2 * b[3] * u + b[4] * v) / self.scale
        dy = dy + (b[2] + 2 * b[5] * v + b[4] * u) / self.scale
        slope: NDArray[np.float64] = np.hypot(dx, dy)
        return slope

    def _normalised(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return (xs - self.center[0]) / self.scale, (ys - self.center[1]) / self.scale


def fit_surface(
    points: NDArray[np.floating],
    r0: float,
    smoothing: float,
    weights: NDArray[np.floating] | None = None,
) -> Surface:
    """Fit z = f(x, y) to points.

    Parameters
    ----------
    points : (n, 3) float, mm, depth camera frame, n >= `MIN_SEEDS`
    r0 : the Gaussian's radius of Eq. (3), mm
    smoothing : lambda, against residuals of unit weight
    weights : (n,) float, positive, relative precision of each point; all 1 where None

    Raises
    ------
    TooLittleDepthError
        Where there are fewer points than `MIN_SEEDS`, or they lie on a line.
    ValueError
        Where an argument is out of its range, or a coordinate is not finite.
    """
    points, W = _checked(points, r0, smoothing, weights)
    xy, z = points[:, :2], points[:, 2]
    center = (float(xy[:, 0].mean()), float(xy[:, 1].mean()))
    scale = float(np.abs(xy - center).max())
    q = _NODE_STEP_SHARP if smoothing < _SHARP_BELOW else _NODE_STEP
    # How many steps exp(-2 q^2 r^2), and its square root, are not negligible.
    near, far = (int(np.ceil(np.sqrt(-np.log(_NEGLIGIBLE) / k) / q)) for k in (2, 1))
    nodes_x, nodes_y = (_nodes(xy[:, axis], q * r0, near) for axis in (0, 1))
    x, y = ((xy - (nodes_x[0], nodes_y[0])) / (q * r0)).T

    # The polynomial is eliminated: what it explains by itself is taken off first, and the node
    # weights are sought beside it. In single precision, which the small rest allows.
    P = _polynomial(xy, center, scale)
    PW = P * W[:, None]
    Q = P.T @ PW
    trend = np.linalg.solve(Q, PW.T @ z)
    rest = z - P @ trend
    root = 2 * q / np.sqrt(np.pi)  # sqrt(c0)
    values = np.zeros((len(z), CHANNELS), np.float32)
    values[:, :6], values[:, 6] = root * PW, root * W * rest
    sums = spread(x, y, values, 2 * q * q, near, len(nodes_y), len(nodes_x))
    C, right = sums[..., :6].reshape(-1, 6).astype(np.float64), sums[..., 6]
    flat = _Flat(len(nodes_y), len(nodes_x), far)
    weight = W.astype(np.float32)
    density = spread_density(2 * (x + far), 2 * (y + far), weight, q * q, far, flat.rows,
                             flat.width).reshape(2, 2, -1)
    G = np.linalg.solve(np.linalg.cholesky(Q), C.T).reshape(6, len(nodes_y), len(nodes_x))
    alpha, _ = conjugate_gradients(
        density, _decay(q, far), smoothing, flat.pad(G), flat.pad(np.ones((1, *right.shape)))[0],
        flat.width, flat.first, flat.size, flat.pad(right[None])[0], _TOLERANCE, _MOST_ITERATIONS)
    found = flat.unpad(alpha)
    beta = trend - np.linalg.solve(Q, C.T @ found.ravel())

    # At the solution the squared residuals follow from the sums at hand.
    squares = (W * rest * rest).sum() - (found * right).sum() - smoothing * (found * found).sum()
    return Surface(nodes_x, nodes_y, root * found, beta, center, scale, r0,
                   noise=float(np.sqrt(max(squares, 0.0) / W.sum())))


@dataclass(frozen=True)
class _Flat:
    """The kernels' flat layout of a (height, breadth) grid: unused places all around it."""

    height: int
    breadth: int
    reach: int

    @property
    def rows(self) -> int:
        return self.height + 2 * self.reach

    @property
    def width(self) -> int:
        return self.breadth + 2 * self.reach

    @property
    def first(self) -> int:
        return self.reach * self.width + self.reach

    @property
    def size(self) -> int:
        return (self.height - 1) * self.width + self.breadth

    def pad(self, grids: NDArray[np.floating]) -> NDArray[np.float32]:
        """(k, height, breadth) -> (k, rows width)."""
        out = np.zeros((len(grids), self.rows, self.width), np.float32)
        out[:, self.reach:-self.reach, self.reach:-self.reach] = grids
        return out.reshape(len(grids), -1)

    def unpad(self, flat: NDArray[np.float32]) -> NDArray[np.float64]:
        """(rows width,) -> (height, breadth)."""
        grid = flat.reshape(self.rows, self.width)
        return grid[self.reach:-self.reach, self.reach:-self.reach].astype(np.float64)


def _decay(q: float, reach: int) -> NDArray[np.float32]:
    """c0 exp(-|t - t'|^2 / R0^2) by steps down and right, 0 where negligible."""
    steps = np.arange(-reach, reach + 1)
    decay = np.exp(-q * q * (steps[:, None] ** 2 + steps**2))
    return np.where(decay > _NEGLIGIBLE, 4 * q * q / np.pi * decay, 0).astype(np.float32)


def _checked(
    points: NDArray[np.floating],
    r0: float,
    smoothing: float,
    weights: NDArray[np.floating] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    checked: NDArray[np.float64] = np.array(points, np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise ValueError(f"points must have shape (n, 3), got {checked.shape}")
    if not np.isfinite(checked).all():
        raise ValueError("points must be finite")
    for name, value in (("r0", r0), ("smoothing", smoothing)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    W: NDArray[np.float64] = np.ones(len(points)) if weights is None else np.array(weights, float)
    if W.shape != (len(points),) or not np.isfinite(W).all() or (W <= 0).any():
        raise ValueError(f"weights must be ({len(points)},), positive and finite")
    if len(points) < MIN_SEEDS:
        raise TooLittleDepthError(f"{len(points)} seeds, a fit needs at least {MIN_SEEDS}")
    extent = np.linalg.svd(checked[:, :2] - checked[:, :2].mean(axis=0), compute_uv=False)
    if extent[1] <= _COLLINEAR * extent[0]:
        raise TooLittleDepthError(f"the {len(points)} seeds lie on a line: no surface to fit")
    return checked, W


def _nodes(values: NDArray[np.float64], step: float, margin: int) -> NDArray[np.float64]:
    """Nodes from `margin` steps before the least value to as many behind the largest."""
    low = float(values.min()) - (margin + 0.5) * step
    count = int(np.ceil(float(np.ptp(values)) / step)) + 2 * margin + 2
    return low + step * np.arange(count, dtype=np.float64)


def _basis(
    values: NDArray[np.floating], nodes: NDArray[np.float64], r0: float, sharpness: float = 2.0
) -> NDArray[np.float64]:
    """exp(-sharpness (value - node)^2 / R0^2), (n, nodes)."""
    gap = (np.asarray(values, np.float64)[:, None] - nodes) / r0
    basis: NDArray[np.float64] = np.exp(-sharpness * gap * gap)
    return basis


def _slope(
    basis: NDArray[np.float64],
    values: NDArray[np.floating],
    nodes: NDArray[np.float64],
    r0: float,
) -> NDArray[np.float64]:
    slope: NDArray[np.float64] = (
        basis * (-4 / r0**2) * (np.asarray(values, np.float64)[:, None] - nodes))
    return slope


def _polynomial(
    xy: NDArray[np.floating], center: tuple[float, float], scale: float
) -> NDArray[np.float64]:
    u, v = ((np.asarray(xy, np.float64) - center) / scale).T
    return np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
