"""Shape from shading: slopes that depth's noise hides, told by the colour image.

After Wu, Zollhoefer et al., 2014, doi:10.1145/2661229.2661232, and Or-El et al., 2015,
doi:10.1109/CVPR.2015.7299179. Skin is brighter where it is turned to the light, and a colour
image has hardly any noise. The lighting is fitted in the frame: spherical harmonics of the
surface's own normals. Brighter or darker than that is a slope that depth did not show, or skin of
another colour. So it counts by as much less as there is much of it around: brows, lips,
moustaches, shadows' edges. Constants: docs/decisions/0016.
"""

import math

import numpy as np

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.detail import _shading_kernels as kernels
from denseface.recon.detail._spherical_harmonics import fit_lighting, sample_harmonics
from denseface.recon.intermediate import ColorSampler
from denseface.recon.noise import Risk
from denseface.recon.numerics.filters import blurred, upsampled
from denseface.recon.numerics.normalized_convolution import normalized, normalized_convolution

_GAMMA = 2.2
"""Exponent from a channel's value to linear light, close to sRGB's curve."""
_CHANNEL_WEIGHTS = (0.3, 0.5, 0.2)
"""Parts of red, green and blue in the brightness."""
_BRIGHTNESS = np.array([part * (np.arange(256) / 255) ** _GAMMA for part in _CHANNEL_WEIGHTS],
                       np.float32)
"""(3, 256), what each value of each channel adds to the brightness, linear, 0-1."""
_SATURATED = 252
"""From this value of any channel on, light may be brighter than the colour says."""
_BLUR_PX = 0.8
"""Standard deviation of the Gaussian that averages the colour image's noise, points of the grid."""
_SPARSE = 4
"""Every so many points each way are enough to fit the lighting."""
_MIN_SHADING = 0.08
"""No shading is taken for darker than this part of the median brightness."""
_MAX_RESIDUAL = 0.5
"""Beyond this logarithm of brightness over shading nothing is skin."""
_SLOW_MM = 10.0
"""Slower changes are of skin and lighting (standard deviation of a Gaussian), mm."""
_ENERGY_MM = 6.0
"""Standard deviation of the Gaussian that averages the squared residuals, mm."""
_COLOR_NOISE = 0.06
"""Root mean square residual from which on points count less: there skin is of many colours."""
_ERROR_FACTOR = 1.2
"""On the surface's expected error: where shading tells most, at lips and lids, it is larger."""
_PRECISION = 9.0
"""1 over the variance of the logarithm on even skin, for each mm^2."""
_STEPS = 3
"""Steps of conjugate gradients: the preconditioner is nearly the inverse."""


def shading_detail(
    heights: Floats, weight: Floats, slopes: Floats, coordinates: tuple[Doubles, Doubles],
    sampler: ColorSampler, plan: Risk,
) -> Floats:
    """Find what is to be added to a surface for its shading to be that of the image.

    heights : (rows, columns) float32, mm
    coordinates : x of the columns, y of the rows, mm
    sampler : tells points' colours
    plan : tells the surface's expected error

    The rest is as of `shape_from_shading`.
    """
    points = kernels.grid_points(weight, *coordinates, heights)
    if not len(points):
        return np.zeros_like(heights)
    weight = weight.copy()
    brightness = kernels.brightness_image(*sampler(points), _BRIGHTNESS, _SATURATED, weight)
    xs = coordinates[0]
    return shape_from_shading(brightness, weight, slopes, float(xs[1] - xs[0]),
                              _ERROR_FACTOR * plan.error_mm, plan.radius_mm)


def shape_from_shading(
    brightness: Floats, weight: Floats, slopes: Floats, step: float, error: float, radius: float
) -> Floats:
    """Find what is to be added to a surface for its shading to be that of the image.

    Of all changes h with a Gaussian's covariance, the one that best explains r, the logarithm of
    brightness over shading: with g the change of the shading's logarithm with the slopes, it makes
    sum w (g . grad h - r)^2 + |h|^2 smallest, the last in the norm of that covariance.

    brightness : (rows, columns) float32, linear, any unit; of no account where `weight` is 0
    weight : (rows, columns) float32, 0-1, how much a point counts
    slopes : (2, rows, columns) float32, dz/dx, dz/dy
    step : distance of points, mm
    error : standard deviation of the error of the surface to be mended, mm
    radius : of the Gaussian whose self-convolution is that error's covariance, mm

    Gives (rows, columns) float32, mm along z; zero where there is too little to fit the lighting.
    """
    brightness, = normalized(blurred(kernels.masked_brightness(brightness, weight), _BLUR_PX))
    dz_dx, dz_dy = slopes
    lighting, median = fit_lighting(*sample_harmonics(brightness, weight, dz_dx, dz_dy, _SPARSE))
    if median <= 0:
        return np.zeros(weight.shape, np.float32)
    system = kernels.shading_residuals(brightness, dz_dx, dz_dy, lighting, _MIN_SHADING * median)
    residuals = system.residuals
    skin = ((weight > 0) & (np.abs(residuals) < np.float32(_MAX_RESIDUAL))).astype(np.float32)
    slow, = normalized_convolution(skin, _SLOW_MM / (2 * step), residuals)
    residuals -= upsampled(slow, residuals.shape)
    energy, = normalized_convolution(skin, _ENERGY_MM / (2 * step), residuals * residuals)
    kernels.apply_weights(system, weight * skin, upsampled(energy, residuals.shape), _COLOR_NOISE,
                          _PRECISION * step**2, step)
    return _solved(system, error, math.sqrt(2) * radius / step)


def _solved(system: kernels.ShadingSystem, error: float, radius: float) -> Floats:
    """Solve by conjugate gradients, with the error's covariance as preconditioner.

    radius : standard deviation of that covariance, points of the grid
    """
    variance = error**2 * 2 * math.pi * radius**2
    values, by_x, by_y = system
    state = kernels.Iterate(*(np.zeros_like(values) for _ in kernels.Iterate._fields))
    kernels.apply_jacobian_transpose(values, by_x, by_y, state.residual)
    norm = 1.0
    for _ in range(_STEPS):
        norm = kernels.conjugate_gradient_step(
            state, blurred(state.residual, radius), variance, by_x, by_y, norm)
        if norm <= 0:
            break
    return state.heights
