"""Symmetry shrinkage: each side of a face is corrected by the mirror image of the other.

Noise differs from side to side, and so do faces. How much of a place's detail the sides have in
common is told by the local moments of the detail d and its mirror image d': with signal variance
P, covariance C and noise variance v, the linear estimate of least squared error is
c1 d + c2 d',  c1 = (P (P + v) - C^2) / D,  c2 = C v / D,  D = (P + v)^2 - C^2,
the Wiener gain P / (P + v) of Lee, 1980, doi:10.1109/TPAMI.1980.4766994, where C = 0. The broad
fit, which is all signal, moves toward its mirror image by v1 / (v1 + v2) of the gap between them,
and by less where the gap is larger than noise alone makes it. What one side alone has (a swelling,
a scar) so stays there, and off the other.

In a hole no detail can be told from noise: its fill is compared as a whole with the whole surface
of the other side, and how far the sides differ is asked of the hole's surroundings.
"""

import math

import cv2
import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.detail import _symmetry_kernels as kernels
from denseface.recon.detail._mirror_kernels import HeightField, mirror_image
from denseface.recon.detail._mirror_plane import MirrorPlane
from denseface.recon.numerics.filters import blurred, upsampled
from denseface.recon.numerics.normalized_convolution import normalized

_MAX_DISTANCE_MM = 12.0
"""A mirror image farther than this from the face is of something else, mm."""
_MIN_FACING = 0.15
"""A mirrored surface that faces the camera by less (cosine) says nothing."""
_GAP_MM = 6.0
"""Standard deviation of the Gaussian over which gaps of the broad fits are averaged, mm."""
_HOLE_GAP_MM = 16.0
"""The same for a hole, whose surroundings tell the gap, mm."""
_DIFFERENCE_MM = 4.0
"""Standard deviation of the Gaussian over which the sides' detail is compared, mm."""
_REACH_MM = 12.0
"""The mirror image is left out so far around a place where the sides differ, mm."""
_DIFFERENT = 1.15
"""Factor on squared differences over their noise: above 1 the sides differ."""


def symmetry_correction(
    field: HeightField, kept: Floats, filled: Floats, hole: Floats, plane: MirrorPlane,
    noise: float, fit_share: float, window: float,
) -> Floats:
    """Find what the mirror image adds to a face.

    field : of five planes; its heights are those of the broad fit
    kept : (rows, columns) float32, the part of the detail that the Wiener gain keeps, mm along z
    filled : (rows, columns) float32, what is added to the broad fit in holes, mm along z
    hole : (rows, columns) float32, 0-1, how much of a place is filled
    plane : to mirror in
    noise : variance of the noise in the detail, mm^2
    fit_share : variance of the error of the broad fit, over that
    window : over which detail counts as local (standard deviation), mm

    Gives (rows, columns) float32, mm along z.
    """
    step = field.step
    image = mirror_image(field, kept + filled, *plane, _MAX_DISTANCE_MM, _MIN_FACING)
    v = max(noise, 1e-12)
    moments, differences, gaps = kernels.mirror_moments(field.planes, image, hole)
    # Peaks are taken of all points: on every second one they would depend on which those are.
    alike = _alike(kernels.peak_differences(
        differences, blurred(differences, _DIFFERENCE_MM / step), _DIFFERENT / 2 / v), step)
    factors = kernels.shrinkage_factors(blurred(moments, window / (2 * step)), alike, v)
    gap_energy = upsampled(normalized(blurred(gaps, _GAP_MM / (2 * step)))[0], hole.shape)
    if hole.any():
        around, = normalized(blurred(gaps, _HOLE_GAP_MM / (2 * step)))
        gap_energy += hole * (upsampled(around, hole.shape) - gap_energy)
    return kernels.correction(field.planes, image, kept, hole, upsampled(factors, hole.shape),
                              gap_energy, fit_share * v)


def _alike(excess: Floats, step: float) -> Floats:
    """Say how far the sides are alike but for noise, 0-1, from their difference over noise."""
    reach = _REACH_MM / (2 * step)
    side = 2 * math.ceil(reach) + 1
    around = cv2.dilate(excess, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    around = cv2.GaussianBlur(around, (0, 0), reach / 2)
    return np.asarray(1 / np.maximum(around, 1) ** 2, np.float32)
