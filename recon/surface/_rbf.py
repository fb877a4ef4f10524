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
The sums over seeds that are left are products of thin matrices too:
`recon.surface._fast_gauss`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.errors import TooLittleDepthError
from denseface.recon.intermediate import SurfaceGrid
from denseface.recon.support import Support
from denseface.recon.surface._conjugate_gradients import NodeSystem, conjugate_gradients
from denseface.recon.surface._fast_gauss import FastGaussTransform
from denseface.recon.surface._trend import Trend

MIN_SEEDS = 50
"""Fewer seeds than this are no face, and leave the polynomial without support."""

_NODE = 2.0
"""Sharpness of g, a node's Gaussian, in units of 1 / R0^2."""
_DENSITY = 4.0
"""Sharpness of its square, of which the matrix is made."""
_NODE_STEPS = ((8.0, 0.50), (0.3, 0.45), (0.0, 0.40))
"""(smoothing over the largest weight, from which on; q): the less smoothing, the closer nodes."""
_NEGLIGIBLE = 3e-5
"""Gaussians below this are left out."""
_TOLERANCE = 3e-5
"""Relative norm of the preconditioned residual at which the iteration ends."""
_MAX_ITERATIONS = 1000
_COLLINEAR = 1e-3
"""Least ratio of the principal extents of seeds that do not lie on a line."""


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
    """

    nodes_x: Doubles
    nodes_y: Doubles
    alpha: Doubles
    beta: Doubles
    center: tuple[float, float]
    scale: float
    r0: float

    def heights(self, xs: Doubles, ys: Doubles) -> Floats:
        """Evaluate on an axis-aligned grid: (k,), (m,) mm -> (m, k) mm."""
        lines: Floats = self._factors(ys, 1) @ self._weights()
        return lines @ self._factors(xs, 0).T

    def sampled(self, xs: Doubles, ys: Doubles) -> Floats:
        """Give f, df/dx, df/dy on an axis-aligned grid: (k,), (m,) mm -> (3, m, k)."""
        factors_x, factors_y, weights = self._factors(xs, 0), self._factors(ys, 1), self._weights()
        lines = factors_y @ weights
        dy_lines = self._derivatives(ys, 1, factors_y) @ weights
        return np.stack([lines @ factors_x.T, lines @ self._derivatives(xs, 0, factors_x).T,
                         dy_lines @ factors_x.T])

    def on_support(self, support: Support) -> SurfaceGrid:
        """Sample on the grid of a support."""
        values = self.sampled(support.xs, support.ys)
        return SurfaceGrid(values, support, detailed=False)

    def _factors(self, values: Doubles, axis: int) -> Floats:
        """The nodes' Gaussians and 1, t, t^2 of the polynomial along one axis."""
        gap = self._gaps(values, axis)
        factors = np.empty((len(gap), gap.shape[1] + 3), np.float32)
        np.exp(np.float32(-_NODE) * gap * gap, out=factors[:, :-3])
        t = (values - self.center[axis]) / self.scale
        factors[:, -3], factors[:, -2], factors[:, -1] = 1, t, t * t
        return factors

    def _derivatives(self, values: Doubles, axis: int, factors: Floats) -> Floats:
        derivatives = np.empty_like(factors)
        np.multiply(np.float32(-2 * _NODE / self.r0) * self._gaps(values, axis), factors[:, :-3],
                    out=derivatives[:, :-3])
        derivatives[:, -3], derivatives[:, -2] = 0, 1 / self.scale
        derivatives[:, -1] = 2 / self.scale * factors[:, -2]
        return derivatives

    def _gaps(self, values: Doubles, axis: int) -> Floats:
        """The distances of the nodes along one axis, in units of R0."""
        nodes = self.nodes_y if axis else self.nodes_x
        return np.subtract.outer(values / self.r0, nodes / self.r0).astype(np.float32)

    def _weights(self) -> Floats:
        """What stands between the factors of y and those of x."""
        weights = np.zeros((len(self.nodes_y) + 3, len(self.nodes_x) + 3), np.float32)
        weights[:-3, :-3] = self.alpha
        b = self.beta
        weights[-3:, -3:] = [[b[0], b[1], b[3]], [b[2], b[4], 0], [b[5], 0, 0]]
        return weights


def fit_surface(
    points: NDArray[np.floating], r0: float, smoothing: float,
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
    x, y, z, W = _checked(points, r0, smoothing, weights)
    # The polynomial is eliminated: its own fit is taken off, and the node weights are sought in
    # what it does not explain. In single precision, which the small residuals allow.
    trend = Trend.of(x, y, z, W)
    transform = FastGaussTransform.of(x, y, (W, trend.residuals), _DENSITY / r0**2)
    relative = smoothing / float(W.max())
    q = next(step for least, step in _NODE_STEPS if relative >= least)
    # How many steps exp(-4 q^2 r^2), of two seeds' Gaussians at a node, and its fourth root are not
    # negligible; nodes begin half a step farther.
    margin, reach = (int(np.ceil(np.sqrt(-np.log(_NEGLIGIBLE) / k) / q - begin))
                     for k, begin in ((4, 0.5), (1, 0)))
    nodes_x, nodes_y = (_nodes(float(values.min()), float(values.max()), q * r0, margin)
                        for values in (x, y))
    root = float(2 * q / np.sqrt(np.pi))  # sqrt(c0)
    sums = np.float32(root) * _node_sums(trend, transform, nodes_x, nodes_y, r0)
    right, shape = sums[6], sums[6].shape
    terms = sums[:6].reshape(6, -1).astype(np.float64)
    G = (np.linalg.inv(np.linalg.cholesky(trend.normal)) @ terms).reshape(6, *shape)
    # `reach` unused entries around the grids, which are flat from here on.
    padded = np.zeros((8, shape[0] + 2 * reach, shape[1] + 2 * reach), np.float32)
    for grid, values in zip(padded[:, reach:-reach, reach:-reach], (*G, right, 1), strict=True):
        grid[:] = values
    flat = padded.reshape(8, -1)
    system = NodeSystem(_density(transform, nodes_x, nodes_y, reach, r0), _decay(q, reach),
                        smoothing, flat[:6], flat[7], padded.shape[2])
    solved = conjugate_gradients(system, flat[6], _TOLERANCE, _MAX_ITERATIONS)
    alpha = solved.reshape(padded.shape[1:])[reach:-reach, reach:-reach].astype(np.float64)
    beta = trend.beta - np.linalg.solve(trend.normal, terms @ alpha.ravel())
    return Surface(nodes_x, nodes_y, root * alpha, beta, trend.center, trend.scale, r0)


def _node_sums(
    trend: Trend, transform: FastGaussTransform, nodes_x: Doubles, nodes_y: Doubles, r0: float
) -> Floats:
    """Sum g(x_i - t) W_i times each polynomial term, and W_i residual_i: (7, rows, columns)."""
    factors_x, factors_y = (
        transform.moment_factors(points, nodes, _NODE / r0**2, center, trend.scale)
        for points, nodes, center in ((transform.x, nodes_x, trend.center[0]),
                                      (transform.y, nodes_y, trend.center[1])))
    by_v = factors_y @ transform.weights(0)
    terms = [by_v[j] @ factors_x[i].T for i, j in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))]
    return np.stack([*terms, (factors_y[0] @ transform.weights(1)) @ factors_x[0].T])


def _density(
    transform: FastGaussTransform, nodes_x: Doubles, nodes_y: Doubles, reach: int, r0: float
) -> Floats:
    """Sum W_i exp(-4 |x_i - s|^2 / R0^2) for s on the padded grid of half steps.

    As four planes of every second point, (2, 2, n).
    """
    half_x, half_y = (nodes[0] + (nodes[1] - nodes[0]) * (np.arange(2 * n) / 2 - reach)
                      for nodes, n in ((nodes_x, len(nodes_x) + 2 * reach),
                                       (nodes_y, len(nodes_y) + 2 * reach)))
    factors_y = transform.factors(transform.y, half_y, _DENSITY / r0**2)
    factors_x = transform.factors(transform.x, half_x, _DENSITY / r0**2)
    lines: Floats = factors_y @ transform.weights(0)
    planes = (lines @ factors_x.T).reshape(len(half_y) // 2, 2, -1, 2).transpose(1, 3, 0, 2)
    return np.ascontiguousarray(planes).reshape(2, 2, -1)


def _decay(q: float, reach: int) -> Floats:
    """c0 exp(-|t - t'|^2 / R0^2) by steps down and right, 0 where negligible."""
    steps = np.arange(-reach, reach + 1)
    decay = np.exp(-q * q * (steps[:, None] ** 2 + steps**2))
    return np.where(decay > _NEGLIGIBLE, 4 * q * q / np.pi * decay, 0).astype(np.float32)


def _checked(
    points: NDArray[np.floating], r0: float, smoothing: float, weights: NDArray[np.floating] | None
) -> tuple[Doubles, Doubles, Doubles, Doubles]:
    """Give x, y, z and W, each contiguous."""
    if np.ndim(points) != 2 or np.shape(points)[1] != 3:
        raise ValueError(f"points must have shape (n, 3), got {np.shape(points)}")
    checked = np.array(np.transpose(points), np.float64, order="C")
    if not np.isfinite(checked).all():
        raise ValueError("points must be finite")
    for name, value in (("r0", r0), ("smoothing", smoothing)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    W: Doubles = np.ones(len(points)) if weights is None else np.array(weights, float)
    if weights is not None and (
            W.shape != (len(points),) or not np.isfinite(W).all() or (W <= 0).any()):
        raise ValueError(f"weights must be ({len(points)},), positive and finite")
    if len(points) < MIN_SEEDS:
        raise TooLittleDepthError(f"{len(points)} seeds, a fit needs at least {MIN_SEEDS}")
    centered = checked[:2] - checked[:2].mean(axis=1, keepdims=True)
    (a, b), (_, c) = (centered @ centered.T).tolist()
    # The larger principal extent, squared; the product of both is the determinant.
    most = (a + c) / 2 + math.hypot((a - c) / 2, b)
    if a * c - b * b <= (_COLLINEAR * most) ** 2:
        raise TooLittleDepthError(f"the {len(points)} seeds lie on a line: no surface to fit")
    x, y, z = checked
    return x, y, z, W


def _nodes(low: float, high: float, step: float, margin: int) -> Doubles:
    """Nodes from `margin` steps before the least value to as many behind the largest."""
    count = int(np.ceil((high - low) / step)) + 2 * margin + 2
    return low - (margin + 0.5) * step + step * np.arange(count, dtype=np.float64)
