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
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from denseface.recon.errors import TooLittleDepthError
from denseface.recon.intermediate import SurfaceGrid
from denseface.recon.support import Support
from denseface.recon.surface._conjugate_gradients import NodeSystem, conjugate_gradients
from denseface.recon.surface._fast_gauss import FastGaussTransform
from denseface.recon.surface._trend import Trend, polynomial

__all__ = ["MIN_SEEDS", "Surface", "fit_surface"]

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

_Float = TypeVar("_Float", np.float32, np.float64)


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
        factors_x, factors_y = self._factors(xs, 0, np.float64), self._factors(ys, 1, np.float64)
        heights: NDArray[np.float64] = (factors_y @ self._weights()) @ factors_x.T
        return heights

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float32]:
        """Evaluate as `on_grid` does, in single precision: (k,), (m,) mm -> (m, k) mm."""
        factors_x, factors_y = self._factors(xs, 0, np.float32), self._factors(ys, 1, np.float32)
        heights: NDArray[np.float32] = (
            factors_y @ self._weights().astype(np.float32)) @ factors_x.T
        return heights

    def sampled(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Give f, df/dx, df/dy on an axis-aligned grid at once, in single precision.

        Parameters
        ----------
        xs, ys : (k,), (m,) float64, mm

        Returns
        -------
        heights, dz_dx, dz_dy : (m, k) float32, mm and unitless
        """
        factors_x, factors_y = self._factors(xs, 0, np.float32), self._factors(ys, 1, np.float32)
        weights: NDArray[np.float32] = self._weights().astype(np.float32)
        lines: NDArray[np.float32] = factors_y @ weights
        heights: NDArray[np.float32] = lines @ factors_x.T
        dz_dx: NDArray[np.float32] = lines @ self._derivatives(xs, 0, factors_x).T
        lines = self._derivatives(ys, 1, factors_y) @ weights
        dz_dy: NDArray[np.float32] = lines @ factors_x.T
        return heights, dz_dx, dz_dy

    def on_support(self, support: Support) -> SurfaceGrid:
        """Sample on the grid of a support."""
        values = np.stack(self.sampled(support.xs, support.ys))
        return SurfaceGrid(values, support, self.noise, detailed=False)

    def _factors(
        self, values: NDArray[np.float64], axis: int, kind: type[_Float]
    ) -> NDArray[_Float]:
        """The nodes' Gaussians and 1, t, t^2 of the polynomial along one axis."""
        gap = self._gaps(values, axis, kind)
        count = gap.shape[1]
        factors = np.empty((len(values), count + 3), kind)
        np.exp(kind(-_NODE) * gap * gap, out=factors[:, :count])
        t = (values - self.center[axis]) / self.scale
        factors[:, count], factors[:, count + 1], factors[:, count + 2] = 1, t, t * t
        return factors

    def _derivatives(
        self, values: NDArray[np.float64], axis: int, factors: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """The derivatives of the factors."""
        gap = self._gaps(values, axis, np.float32)
        count = gap.shape[1]
        derivatives = np.empty_like(factors)
        np.multiply(np.float32(-2 * _NODE / self.r0) * gap, factors[:, :count],
                    out=derivatives[:, :count])
        derivatives[:, count], derivatives[:, count + 1] = 0, 1 / self.scale
        derivatives[:, count + 2] = 2 / self.scale * factors[:, count + 1]
        return derivatives

    def _gaps(
        self, values: NDArray[np.float64], axis: int, kind: type[_Float]
    ) -> NDArray[_Float]:
        """The distances of the nodes along one axis, in units of R0."""
        nodes = self.nodes_y if axis else self.nodes_x
        return np.subtract.outer(values / self.r0, nodes / self.r0).astype(kind)

    def _weights(self) -> NDArray[np.float64]:
        """What stands between the factors of y and those of x."""
        weights = np.zeros((len(self.nodes_y) + 3, len(self.nodes_x) + 3))
        weights[:-3, :-3] = self.alpha
        b = self.beta
        weights[-3:, -3:] = [[b[0], b[1], b[3]], [b[2], b[4], 0], [b[5], 0, 0]]
        return weights

    def at(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Evaluate at scattered points: (n, 2) mm -> (n,) mm."""
        ex = _basis(xy[:, 0], self.nodes_x, self.r0)
        ey = _basis(xy[:, 1], self.nodes_y, self.r0)
        heights: NDArray[np.float64] = np.einsum("ij,ij->i", ey @ self.alpha, ex)
        return heights + polynomial(xy, self.center, self.scale) @ self.beta


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
    sums, right = _node_sums(trend, transform, nodes_x, nodes_y, r0)
    sums *= np.float32(root)
    right *= np.float32(root)
    terms = sums.reshape(6, -1).astype(np.float64)
    G = (np.linalg.inv(np.linalg.cholesky(trend.normal)) @ terms).reshape(sums.shape)
    grid = _PaddedGrid(len(nodes_y), len(nodes_x), reach)
    system = NodeSystem(
        _density(transform, nodes_x, nodes_y, grid, r0), _decay(q, reach), smoothing, grid.pad(G),
        grid.pad(np.ones((1, *right.shape)))[0], grid.width, grid.first, grid.size)
    flat, _ = conjugate_gradients(system, grid.pad(right[None])[0], _TOLERANCE, _MAX_ITERATIONS)
    alpha = grid.unpad(flat)
    beta = trend.beta - np.linalg.solve(trend.normal, terms @ alpha.ravel())

    # At the solution the squared residuals follow from the sums at hand.
    squares = trend.squares - (alpha * right).sum() - smoothing * (alpha * alpha).sum()
    return Surface(nodes_x, nodes_y, root * alpha, beta, trend.center, trend.scale, r0,
                   noise=float(np.sqrt(max(squares, 0.0) / float(W.sum()))))


def _node_sums(
    trend: Trend, transform: FastGaussTransform, nodes_x: NDArray[np.float64],
    nodes_y: NDArray[np.float64], r0: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Sum g(x_i - t) W_i times each polynomial term, (6, rows, columns), and W_i residual_i."""
    factors_x, factors_y = (
        transform.moment_factors(points, nodes, _NODE / r0**2, center, trend.scale)
        for points, nodes, center in ((transform.x, nodes_x, trend.center[0]),
                                      (transform.y, nodes_y, trend.center[1])))
    by_v = factors_y @ transform.weights(0)
    terms = [by_v[j] @ factors_x[i].T for i, j in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))]
    return np.stack(terms), (factors_y[0] @ transform.weights(1)) @ factors_x[0].T


def _density(
    transform: FastGaussTransform, nodes_x: NDArray[np.float64], nodes_y: NDArray[np.float64],
    grid: "_PaddedGrid", r0: float,
) -> NDArray[np.float32]:
    """Sum W_i exp(-4 |x_i - s|^2 / R0^2) for s on a grid of half steps.

    As four planes of every second point, (2, 2, rows width).
    """
    half_x, half_y = (
        nodes[0] + (nodes[1] - nodes[0]) * (np.arange(2 * n) / 2 - grid.reach)
        for nodes, n in ((nodes_x, grid.width), (nodes_y, grid.rows)))
    factors_y = transform.factors(transform.y, half_y, _DENSITY / r0**2)
    factors_x = transform.factors(transform.x, half_x, _DENSITY / r0**2)
    lines: NDArray[np.float32] = factors_y @ transform.weights(0)
    halves: NDArray[np.float32] = lines @ factors_x.T
    planes = halves.reshape(grid.rows, 2, grid.width, 2).transpose(1, 3, 0, 2)
    return np.ascontiguousarray(planes).reshape(2, 2, -1)


@dataclass(frozen=True)
class _PaddedGrid:
    """The kernels' flat layout of a (height, breadth) grid: `reach` unused entries around it."""

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
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Give x, y, z and W, each contiguous."""
    if np.ndim(points) != 2 or np.shape(points)[1] != 3:
        raise ValueError(f"points must have shape (n, 3), got {np.shape(points)}")
    checked: NDArray[np.float64] = np.array(np.transpose(points), np.float64, order="C")
    if not np.isfinite(checked).all():
        raise ValueError("points must be finite")
    for name, value in (("r0", r0), ("smoothing", smoothing)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    W: NDArray[np.float64] = np.ones(len(points)) if weights is None else np.array(weights, float)
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


def _nodes(low: float, high: float, step: float, margin: int) -> NDArray[np.float64]:
    """Nodes from `margin` steps before the least value to as many behind the largest."""
    count = int(np.ceil((high - low) / step)) + 2 * margin + 2
    return low - (margin + 0.5) * step + step * np.arange(count, dtype=np.float64)


def _basis(
    values: NDArray[np.floating], nodes: NDArray[np.float64], r0: float
) -> NDArray[np.float64]:
    """The nodes' Gaussians at some values, (n, nodes)."""
    gap = (np.asarray(values, np.float64)[:, None] - nodes) / r0
    basis: NDArray[np.float64] = np.exp(-_NODE * gap * gap)
    return basis
