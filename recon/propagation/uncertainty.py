"""Stage 6: how far off each dense point may be, along its viewing ray.

    sigma^2 = r^2 (B b + W w + M m) + H d^2 (1 + g^2) + S j^2 h^2 g^4 + e g^2 (E h^2 + J j^2)

r, mm : what the seeds around the point are off the surface, root mean square
b, w, m : expected squares of what the fit takes off the face, and of white and smooth noise that it
    lets pass, over r^2: `recon.noise.Risk`
d, mm : how far into a hole: distance from the nearest seed, less one spacing
h, mm : mean spacing of the seeds, which grows with the distance from the camera
g : slope of the surface: where it is steep, a reading's sideways jitter is depth
j, mm : that jitter, told by how much more the seeds are off where it is steep
e, 0-1 : how near the rim, where seeds lie on one side alone; 1 on it

and never less than what the levels of depth leave, `recon.noise.Noise.level_error_mm`. Were the
model of face and noise the whole truth, B, W and M would be 1. The coefficients are those of
twelve kinds of simulated sensor together, on the heads that settings are chosen on, that hold
nearest to 68 % within one sigma and 95 % within two: everywhere, in holes and at the rim
(docs/decisions/0053-an-engine-for-any-sensor.md; by maximum likelihood alone: `python -m
bench.calibration --fit`).
"""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.noise import Risk
from denseface.recon.numerics.filters import filtered, gaussian_taps
from denseface.recon.numerics.jit import compiled

__all__ = ["VarianceComponents", "standard_error", "variance_components"]


class _Coefficients(NamedTuple):
    """Of `sigma`'s square: B, W, M, H, S, E, J."""

    bias: float
    white: float
    smooth: float
    hole: float
    slope: float
    rim: float
    rim_jitter: float


_DETAILED = _Coefficients(5.0, 0.5, 0.8, 0.13, 0.05, 0.3, 3.2)
"""Of a fit with detail, which has a broad average at the rim."""
_FIT_ALONE = _Coefficients(0.5, 3.8, 2.75, 0.36, 0.03, 0.9, 17.0)
"""Of a fit without."""

_STEEP, _FLAT = 0.8, 0.3
"""Squared slopes above and below which residuals are compared to tell the jitter."""
_USUAL_JITTER, _JITTER_SEEDS = 0.35, 100.0
"""j^2 where no frame tells it, over h^2, and the weight of that, in seeds."""
_WINDOW = 2.5
"""Standard deviation of the Gaussian over which residuals and slopes count as local, spacings."""
_PRIOR = 0.03
"""Weight of the whole face's residuals, in seeds for each squared spacing."""
_MIN_SIGMA_MM = 0.05
"""What averaging tens of readings in whole millimetres leaves of their 0.29 mm, mm."""


class VarianceComponents(NamedTuple):
    """The parts of sigma^2 before their coefficients, on every so many points of a grid.

    Attributes
    ----------
    noise, hole, slope, rim, rim_jitter : r^2, d^2 (1 + g^2), j^2 h^2 g^4, e h^2 g^2, e j^2 g^2,
        (rows, columns) float32, mm^2
    every : grid points from node to node
    """

    noise: Floats
    hole: Floats
    slope: Floats
    rim: Floats
    rim_jitter: Floats
    every: int


def variance_components(
    points: Floats, support: Bools, surface: Floats, origin: tuple[float, float], step: float,
    spacing: float,
) -> VarianceComponents:
    """Find the components of the variance, place by place.

    Parameters
    ----------
    points : (n, 3) float32, mm, the seeds, depth camera frame
    support : (rows, columns) bool, where the dense grid has points
    surface : (3, rows, columns) float32, height, mm, dz/dx and dz/dy; used on the support alone
    origin : (x, y) of the grid's first point, mm
    step : distance of its points, mm
    spacing : h, mean spacing of the seeds, mm
    """
    every = max(1, round(spacing / step))
    node = every * step / spacing
    nodes = node_statistics(points, support, surface, origin, step, every)
    far = cv2.distanceTransform((nodes[..., 2] == 0).astype(np.uint8), cv2.DIST_L2, 5)
    levels = _by_slope(nodes)
    _, _, seeds, squares = levels[2]
    jitter = _squared_jitter(levels, spacing)
    prior = _PRIOR * node**2
    parts = _components(filtered(nodes, gaussian_taps(_WINDOW / node)), far, prior,
                        prior * squares / max(seeds, 1.0), node, spacing, jitter)
    noise, hole, slope, rim, rim_jitter = parts
    return VarianceComponents(noise, hole, slope, rim, rim_jitter, every)


def _squared_jitter(levels: Doubles, spacing: float) -> float:
    """Tell j^2, mm^2, by the squared residuals of seeds where it is steep and where it is not.

    levels : of `_by_slope`; spacing : h, mm
    """
    steep, some, residual = (float(one) for one in levels[0, 1:])
    flat, others, least = (float(one) for one in levels[1, 1:])
    steep, residual = steep / max(some, 1.0), residual / max(some, 1.0)
    flat, least = flat / max(others, 1.0), least / max(others, 1.0)
    usual = _USUAL_JITTER * spacing**2
    seeds = min(some, others)
    if seeds == 0:
        return usual
    found = max(residual - least, 0.0) / (steep - flat)
    return (seeds * found + _JITTER_SEEDS * usual) / (seeds + _JITTER_SEEDS)


@compiled
def _by_slope(nodes: Floats) -> Doubles:
    """Sum nodes of `node_statistics` where it is steep, where it is not, and everywhere, (3, 4).

    Of each: their number, their seeds times slope^2, their seeds, those' squared residuals.
    """
    sums = np.zeros((3, 4))
    for i in range(nodes.shape[0]):
        for j in range(nodes.shape[1]):
            slope, count, square = nodes[i, j, 1], nodes[i, j, 2], nodes[i, j, 3]
            if count == 0:
                continue
            kind = 0 if slope > _STEEP else 1 if slope < _FLAT else 2
            sums[kind, 0] += 1
            sums[kind, 1] += count * slope
            sums[kind, 2] += count
            sums[kind, 3] += square
    for k in range(4):
        sums[2, k] += sums[0, k] + sums[1, k]
    return sums


@compiled
def _components(
    local: Floats, far: Floats, prior: float, prior_square: float, node: float, spacing: float,
    jitter: float,
) -> Floats:
    """Give the components of the variance, (5, rows, columns).

    local : (rows, columns, 4), `node_statistics`, blurred
    far : (rows, columns), from each node to the nearest with a seed, nodes
    prior, prior_square : weight of the whole face's residuals, and that times their mean square
    node : from node to node, spacings; spacing : mm; jitter : j^2, mm^2
    """
    rows, columns = far.shape
    out = np.empty((5, rows, columns), np.float32)
    one, two, zero = np.float32(1), np.float32(2), np.float32(0)
    weight, more, least = np.float32(prior), np.float32(prior_square), np.float32(1e-3)
    h, side, j2 = np.float32(spacing), np.float32(node), np.float32(jitter)
    for i in range(rows):
        for j in range(columns):
            covered = local[i, j, 0]
            slope = local[i, j, 1] / max(covered, least)
            deep = h * max(side * far[i, j] - one, zero)
            edge = slope * min(max(two - two * covered, zero), one)
            out[0, i, j] = (local[i, j, 3] + more) / (local[i, j, 2] + weight)
            out[1, i, j] = deep * deep * (one + slope)
            out[2, i, j] = j2 * h * h * slope * slope
            out[3, i, j] = h * h * edge
            out[4, i, j] = j2 * edge
    return out


@compiled
def node_statistics(
    points: Floats, support: Bools, surface: Floats, origin: tuple[float, float], step: float,
    every: int,
) -> Floats:
    """Gather what the standard error is made of on every so many grid points, the nodes.

    points : (n, 3), mm; those off the support do not count
    support : (rows, columns)
    surface : (3, rows, columns), height, mm, dz/dx and dz/dy
    origin : (x, y) of the grid's first point, mm; step : distance of its points, mm

    Gives (rows / every, columns / every, 4), rounded up: 1 on the support, slope^2 there, seeds
    nearest to the node, sum of their squared residuals, mm^2.
    """
    rows, columns = support.shape
    heights, slopes_x, slopes_y = surface[0], surface[1], surface[2]
    out = np.zeros(((rows + every - 1) // every, (columns + every - 1) // every, 4), np.float32)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            row, column = i * every, j * every
            if support[row, column]:
                dx, dy = slopes_x[row, column], slopes_y[row, column]
                out[i, j, 0] = 1
                out[i, j, 1] = dx * dx + dy * dy
    per_step = 1 / step
    for k in range(len(points)):
        x, y = (points[k, 0] - origin[0]) * per_step, (points[k, 1] - origin[1]) * per_step
        if not (-0.5 <= y < rows - 0.5 and -0.5 <= x < columns - 0.5):
            continue
        row, column = int(y + 0.5), int(x + 0.5)
        if support[row, column]:
            rest = points[k, 2] - heights[row, column] - step * (
                slopes_x[row, column] * (x - column) + slopes_y[row, column] * (y - row))
            i = min((row + every // 2) // every, out.shape[0] - 1)
            j = min((column + every // 2) // every, out.shape[1] - 1)
            out[i, j, 2] += 1
            out[i, j, 3] += rest * rest
    return out


def standard_error(components: VarianceComponents, plan: Risk, *, detailed: bool) -> Floats:
    """Give sigma on the nodes of its components.

    Parameters
    ----------
    components : of this face's variance
    plan : the expected error of the fit
    detailed : whether detail was added to it

    Returns
    -------
    (rows, columns) float32, mm: 68 % of the errors along the viewing ray are within it, 95 % within
    twice
    """
    c = _DETAILED if detailed else _FIT_ALONE
    share = (c.bias * plan.bias_share + c.white * plan.white_share
             + c.smooth * plan.smooth_share)
    variance = (np.float32(share) * components.noise + np.float32(c.hole) * components.hole
                + np.float32(c.slope) * components.slope + np.float32(c.rim) * components.rim
                + np.float32(c.rim_jitter) * components.rim_jitter)
    least = np.float32(max(plan.least_mm, _MIN_SIGMA_MM))
    return np.asarray(np.maximum(np.sqrt(variance), least), np.float32)
