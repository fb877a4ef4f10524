"""What the colour image's shading says of the shape that depth's noise hides.

After Wu, Zollhoefer et al., 2014, doi:10.1145/2661229.2661232, and Or-El et al., 2015,
doi:10.1109/CVPR.2015.7299179. Skin is brighter where it is turned to the light, and a colour
image has hardly any noise. The light is found in the frame: spherical harmonics of the surface's
own normals, fitted to its brightness. What is brighter or darker than that is a slope that depth
did not show, or skin of another colour. So it counts by as much less as there is much of it around:
brows, lips, moustaches, shadows' edges.
"""

import math

import numpy as np
from numpy.typing import NDArray

from denseface.recon.detail._shading_kernels import (
    apply_jacobian_transpose,
    brightness_image,
    conjugate_gradient_step,
    grid_points,
    masked_brightness,
    shading_residuals,
    weigh,
)
from denseface.recon.detail._spherical_harmonics import fit_lighting, sample_harmonics
from denseface.recon.intermediate import ColorSampler
from denseface.recon.numerics.filters import blurred, upsampled
from denseface.recon.numerics.normalized_convolution import normalized, normalized_convolution

__all__ = ["shading_detail", "shape_from_shading"]

Image = NDArray[np.float32]

_GAMMA = 2.2
# Red, green, blue.
_SHARES = (0.3, 0.5, 0.2)
_LINEAR = np.array([share * (np.arange(256) / 255) ** _GAMMA for share in _SHARES], np.float32)
# What is as bright in any colour may be brighter still.
_FULL = 252
# A colour image's noise is averaged over so many places (standard deviation).
_AVERAGED = 0.8
# Every so many places each way are enough to find the light.
_SPARSE = 4
# No shade is taken for darker than this share of the median.
_LEAST = 0.08
# Beyond this logarithm nothing is skin.
_NOT_SKIN = 0.5
# Slower changes are of skin and light (standard deviation).
_SLOW_MM = 10.0
# Over what radius brightness tells how much of it is not shape, and the least that is so.
_AROUND_MM = 6.0
_COLORED = 0.06
# Error of the surface to be mended: standard deviation, and radius of its Gaussian.
_ERROR_MM = 0.6
_RADIUS_MM = 3.0
# How much one mm^2 of even skin tells: 1 over the variance of the logarithm.
_TOLD = 9.0
_STEPS = 3


def shading_detail(
    heights: Image, weight: Image, slopes: tuple[Image, Image],
    places: tuple[NDArray[np.float64], NDArray[np.float64]], sampler: ColorSampler,
) -> Image:
    """Find what is to be added to a surface for its shading to be that of the image.

    Parameters
    ----------
    heights : (rows, columns) float32, mm
    weight : (rows, columns) float32, 0-1, how much a place counts
    slopes : dz/dx, dz/dy, (rows, columns) float32
    places : x of the columns, y of the rows, mm
    sampler : tells points' colours

    Returns
    -------
    (rows, columns) float32, mm along z
    """
    points = grid_points(weight, *places, heights)
    if not len(points):
        return np.zeros_like(heights)
    weight = weight.copy()
    brightness = brightness_image(*sampler(points), _LINEAR, _FULL, weight)
    return shape_from_shading(brightness, weight, slopes, float(places[0][1] - places[0][0]))


def shape_from_shading(
    brightness: Image, weight: Image, slopes: tuple[Image, Image], step: float
) -> Image:
    """Find what is to be added to a surface for its shading to be that of the image.

    Of all changes h with a Gaussian's covariance, the one that best explains r, the logarithm of
    brightness over light: with g the change of the light's logarithm with the slopes, it makes
    sum w (g . grad h - r)^2 + |h|^2 smallest, the last in the norm of that covariance.

    Parameters
    ----------
    brightness : (rows, columns) float32, linear, any unit; what it is where `weight` is 0 does
        not count
    weight : (rows, columns) float32, 0-1, how much a place counts
    slopes : dz/dx, dz/dy, (rows, columns) float32
    step : distance of places, mm

    Returns
    -------
    (rows, columns) float32, mm along z; zero where there is too little to find the light
    """
    across, down = slopes
    brightness, = normalized(blurred(masked_brightness(brightness, weight), _AVERAGED))
    light, median = fit_lighting(*sample_harmonics(brightness, weight, across, down, _SPARSE))
    if median <= 0:
        return np.zeros(weight.shape, np.float32)
    residuals, right, lower = (np.empty(weight.shape, np.float32) for _ in range(3))
    shading_residuals(brightness, across, down, light, _LEAST * median, residuals, right, lower)
    skin = ((weight > 0) & (np.abs(residuals) < np.float32(_NOT_SKIN))).astype(np.float32)
    slow, = normalized_convolution(skin, _SLOW_MM / (2 * step), residuals)
    residuals -= upsampled(slow, residuals.shape)
    energy, = normalized_convolution(skin, _AROUND_MM / (2 * step), residuals * residuals)
    weigh(residuals, right, lower, weight * skin, upsampled(energy, residuals.shape), _COLORED,
          _TOLD * step**2, step)
    return _solved(residuals, right, lower, step)


def _solved(values: Image, right: Image, lower: Image, step: float) -> Image:
    """Solve by conjugate gradients, with the covariance as preconditioner: few steps are enough."""
    radius = math.sqrt(2) * _RADIUS_MM / step
    variance = _ERROR_MM**2 * 2 * math.pi * radius**2
    rest, heights, way, smooth_way = (np.zeros_like(values) for _ in range(4))
    apply_jacobian_transpose(values, right, lower, rest)
    last = 1.0
    for _ in range(_STEPS):
        last = conjugate_gradient_step(
            rest, blurred(rest, radius), variance, right, lower, way, smooth_way, heights, last)
        if last <= 0:
            break
    return heights
