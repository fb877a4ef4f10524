"""A face's two sides show the same shape twice: each is helped by the mirror image of the other.

Noise differs from side to side, and so do faces. How much of a place's detail the sides have in
common is told by the local moments of the detail d and its mirror image d': with signal variance
P, covariance C and noise variance v, the linear estimate of least squared error is
c1 d + c2 d',  c1 = (P (P + v) - C^2) / D,  c2 = C v / D,  D = (P + v)^2 - C^2,
Lee's gain P / (P + v) where C = 0. The broad fit, which is all signal, moves toward its mirror
image by v1 / (v1 + v2) of the gap between them, and by less where the gap is larger than noise
alone makes it. What one side alone has (a swelling, a scar) so stays there, and off the other.

In a hole there is no detail to be told from noise: what fills it is compared as a whole with the
whole surface of the other side, and how far the sides differ is asked of the hole's surroundings.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detail._mirror_kernels import mirror_image
from denseface.recon.detail._mirror_plane import MirrorPlane
from denseface.recon.detail._symmetry_kernels import (
    add_mirrored,
    halved_moments,
    halved_peaks,
    parts_kept,
)
from denseface.recon.numerics.filters import blurred, upsampled
from denseface.recon.numerics.normalized_convolution import normalized

__all__ = ["symmetry_correction"]

Image = NDArray[np.float32]

# A mirror image farther than this from the face is of something else; one that looks aside by
# more than the second (cosine) says nothing.
_FARTHEST_MM = 12.0
_STEEPEST = 0.15
# Gaps of the broad fits are told from noise over this radius (standard deviation); for a hole, of
# whose border they tell, over the second.
_GAP_MM = 6.0
_AROUND_HOLE_MM = 16.0
# Variance of the broad fit over that of the detail's noise.
_BROAD = 0.25
# In a hole a fit is worth this share of one between seeds; with less of it, the mirror image fills
# the hole even where the sides differ.
_LEAST = 0.2
# Where the detail of the sides, averaged over the first radius, differs by more than noise, the
# mirror image is left out as far as the second around.
_DIFFERENT_MM = 4.0
_AROUND_MM = 12.0
_DIFFERENT = 1.15


def symmetry_correction(
    field: Image, kept: Image, filled: Image, hole: Image, plane: MirrorPlane, noise: float,
    window: float, origin: tuple[float, float], step: float,
) -> Image:
    """Find what the mirror image adds to a face.

    Parameters
    ----------
    field : (rows, columns, 5) float32: the broad fit's height, mm; share of its normal along z;
        weight as a mirror image, 0-1; detail, mm along the normal; weight of the seeds, 0-1
    kept : (rows, columns) float32, the part of the detail that Lee's gain keeps, mm along z
    filled : (rows, columns) float32, what is added to the broad fit in holes, mm along z
    hole : (rows, columns) float32, 0-1, how much of a place is filled
    plane : to mirror in
    noise : variance of the noise in the detail, mm^2
    window : over which detail counts as local (standard deviation), mm
    origin : (x, y) of the first point, mm
    step : distance of points, mm

    Returns
    -------
    (rows, columns) float32, mm along z
    """
    image = mirror_image(field, kept + filled, np.asarray(origin), step, plane.normal,
                         plane.offset, _FARTHEST_MM, _STEEPEST)
    v = max(noise, 1e-12)
    moments, differences, gaps = halved_moments(field, image, hole)
    # On every second point alone it would depend on which they are how large the largest is.
    same = _same(halved_peaks(differences, blurred(differences, _DIFFERENT_MM / step),
                              _DIFFERENT / 2 / v), step)
    parts = parts_kept(blurred(moments, window / (2 * step)), same, v)
    differs = upsampled(normalized(blurred(gaps, _GAP_MM / (2 * step)))[0], hole.shape)
    if hole.any():
        around, = normalized(blurred(gaps, _AROUND_HOLE_MM / (2 * step)))
        differs += hole * (upsampled(around, hole.shape) - differs)
    return add_mirrored(field, image, kept, hole, upsampled(parts, hole.shape), differs,
                        _BROAD * v, _LEAST)


def _same(excess: Image, step: float) -> Image:
    """How far the detail of both sides is alike but for noise, 0-1; of what it is above noise."""
    reach = _AROUND_MM / (2 * step)
    side = 2 * math.ceil(reach) + 1
    around = cv2.dilate(excess, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    around = cv2.GaussianBlur(around, (0, 0), reach / 2)
    return np.asarray(1 / np.maximum(around, 1) ** 2, np.float32)
