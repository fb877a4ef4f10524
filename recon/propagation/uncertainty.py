"""Stage 6: how far off each dense point may be, along its viewing ray.

    sigma^2 = k r^2 (1 + H d) + S (h g^2)^2 + E e (h g)^2

r, mm : what the seeds around the point are off the surface, root mean square: the sensor's noise
    and detail that smoothing took away, k of it left in the surface (`noise_fraction`)
d, spacings : how far into a hole: distance from the nearest seed, less one
h, mm : mean spacing of the seeds, which grows with the distance from the camera
g : slope of the surface: where it is steep, a reading's sideways jitter, as large as h, is depth
e, 0-1 : how near the rim, where seeds lie on one side alone; 1 on it

A Gaussian process has its own posterior variance, but only where noise is independent from seed
to seed and the fit has no bias: a Kinect's is correlated over several pixels, and lips, lids and
nostrils are bias. So the form is made of what an error can come from, and the coefficients are
fitted by maximum likelihood to simulated frames with known truth (`python -m bench.calibration
--fit`, on the heads that settings are chosen on; docs/decisions/0007-sigma.md).
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.numerics.filters import filtered, gaussian_taps
from denseface.recon.numerics.jit import compiled
from denseface.recon.settings import Settings

__all__ = ["VarianceComponents", "averaging_cutoff", "fit_cutoff", "noise_fraction",
           "standard_error", "variance_components"]

_HOLE = 0.4
"""H, for each spacing into a hole. This and the next five: `bench/calibration.py --fit`."""
_SLOPE = 0.075
"""S, of a slope squared."""
_RIM = 1.46
"""E of a fit with detail, which has a broad average at the rim."""
_RIM_FIT_ALONE = 2.4
"""E of a fit without detail."""
_FIT_FRACTION = 90.0
"""Of `noise_fraction`: over the squared cut-off of the fit."""
_DETAIL_FRACTION = 0.12
"""Of `noise_fraction`: what detail brings back, over what its own average would let pass."""

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
    noise, hole, slope, rim : r^2, r^2 d, (h g^2)^2, e (h g)^2, (rows, columns) float32, mm^2
    every : grid points from node to node
    """

    noise: Floats
    hole: Floats
    slope: Floats
    rim: Floats
    every: int


def noise_fraction(settings: Settings) -> float:
    """Give k: what fraction of the residuals' variance is error left in the surface.

    A smoother lets pass what is longer than some L, where signal and smoothing weigh the same: of
    noise, a fraction in proportion to (h / L)^2. Detail that is added to the fit brings back a part
    of what its own average lets pass.
    """
    fraction = _FIT_FRACTION * fit_cutoff(settings.r0_factor, settings.smoothing) ** 2
    if settings.detail_factor is not None:
        fraction += _DETAIL_FRACTION * _FIT_FRACTION * averaging_cutoff(settings.detail_factor) ** 2
    return fraction


def fit_cutoff(r0_factor: float, smoothing: float) -> float:
    """Give the cut-off h / L of a fit, L = pi R0 / sqrt(ln(pi (R0/h)^2 / lambda))."""
    weight = max(math.pi * r0_factor**2 / smoothing, math.e)
    return math.sqrt(math.log(weight)) / (math.pi * r0_factor)


def averaging_cutoff(detail_factor: float) -> float:
    """Give the cut-off h / L of a Gaussian average: of a wave of length L, half is left."""
    return math.sqrt(math.log(2) / 2) / (math.pi * detail_factor)


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
    seeds, squares = nodes[..., 2].sum(dtype=np.float64), nodes[..., 3].sum(dtype=np.float64)
    covered, slope, count, square = cv2.split(filtered(nodes, gaussian_taps(_WINDOW / node)))
    prior = np.float32(_PRIOR * node**2)
    noise = (square + prior * np.float32(squares / max(seeds, 1.0))) / (count + prior)
    hole = noise * np.maximum(np.float32(node) * far - 1, np.float32(0))
    slope /= np.maximum(covered, np.float32(1e-3))
    area = np.float32(spacing**2)
    edge = np.clip(2 - 2 * covered, np.float32(0), np.float32(1))
    return VarianceComponents(
        noise=np.asarray(noise, np.float32), hole=np.asarray(hole, np.float32),
        slope=np.asarray(area * slope * slope, np.float32),
        rim=np.asarray(area * slope * edge, np.float32), every=every)


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
    for k in range(len(points)):
        x, y = (points[k, 0] - origin[0]) / step, (points[k, 1] - origin[1]) / step
        row, column = int(np.floor(y + 0.5)), int(np.floor(x + 0.5))
        if 0 <= row < rows and 0 <= column < columns and support[row, column]:
            rest = points[k, 2] - heights[row, column] - step * (
                slopes_x[row, column] * (x - column) + slopes_y[row, column] * (y - row))
            i = min((row + every // 2) // every, out.shape[0] - 1)
            j = min((column + every // 2) // every, out.shape[1] - 1)
            out[i, j, 2] += 1
            out[i, j, 3] += rest * rest
    return out


def standard_error(
    components: VarianceComponents, noise_fraction: float, *, detailed: bool
) -> Floats:
    """Give sigma on the nodes of its components.

    Parameters
    ----------
    components : of this face's variance
    noise_fraction : k, of the settings that the surface was fitted with
    detailed : whether detail was added to the fit

    Returns
    -------
    (rows, columns) float32, mm: 68 % of the errors along the viewing ray are within it, 95 % within
    twice
    """
    rim = np.float32(_RIM if detailed else _RIM_FIT_ALONE)
    variance = (np.float32(noise_fraction)
                * (components.noise + np.float32(_HOLE) * components.hole)
                + np.float32(_SLOPE) * components.slope + rim * components.rim)
    return np.asarray(np.maximum(np.sqrt(variance), np.float32(_MIN_SIGMA_MM)), np.float32)
