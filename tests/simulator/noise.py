"""How a Kinect's depth differs from the truth.

Lateral jitter: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D
reconstruction and tracking", 3DIMPVT 2012. Axial noise and its correlation: fitted to a real
Kinect recording (standard deviation over time by distance, correlation between neighbours).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulator.camera_views import SUPERSAMPLING, DepthView
from tests.simulator.shift import depth_to_shift, quantize

__all__ = ["depth_noise_mm", "noisy_depth"]

Floats = NDArray[np.float32]

_JITTER_PX = 0.5
_JITTER_CORRELATION_PX = 1.3
_CONTINUOUS = 0.012
"""Neighbouring samples farther apart than this share of the depth are not one surface."""
_AXIAL = ((0.18, 0.0), (0.46, 1.4), (0.36, 3.1))
"""(share of the axial variance, its correlation length in pixels): with the quantiser's own noise,
the real recording's correlation over 1, 2, 4, 6, 8 pixels (0.64, 0.45, 0.24, 0.11, 0.05), as the
mean of its bands at 0.55-0.75 and 1.0-1.5 m; between them a person moves."""
_STEADY_SHARE = 0.22
"""Share of the axial variance that is the same in every frame of a still scene: what Nguyen's
total (1.37 mm at 0.7 m) leaves beside the recording's variance over time (1.22 mm)."""
_EDGE_PX, _EDGE_CORRELATION_PX, _EDGE_REACH_PX = 1.2, 2.6, 4
"""At depth edges the matching window takes one side or the other in small blocks."""
_GRAZING = (0.10, 0.28)
"""Cosine of incidence: never a reading below the first, always above the second."""


def depth_noise_mm(depth_mm: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the axial noise, mm, standard deviation, at a depth in mm."""
    z = np.asarray(depth_mm, np.float64) / 1000
    return 1.17 + 2.0 * np.maximum(z - 0.65, 0) ** 2


def noisy_depth(
    view: DepthView, hole_share: Floats, steady: np.random.Generator,
    changing: np.random.Generator,
) -> NDArray[np.uint16]:
    """Make one depth image, (H, W) uint16 mm, of a true view.

    Parameters
    ----------
    view : the truth, supersampled
    hole_share : (H, W) float32, 0-1, supersampled: how likely there is no reading
    steady : what is the same in each frame of a still scene; give it afresh for each frame
    changing : what differs between frames
    """
    height = view.camera.height // SUPERSAMPLING
    width = view.camera.width // SUPERSAMPLING
    shape = (height, width)
    u, v = _jittered(view, shape, steady, changing)
    depth = _look_up(view, u, v)
    slant = _nearest(view.slant, u, v)
    lit = _nearest(view.lit.astype(np.uint8), u, v) > 0

    sigma = depth_noise_mm(np.maximum(depth, 1))
    noise = (np.sqrt(_STEADY_SHARE) * _axial(shape, steady)
             + np.sqrt(1 - _STEADY_SHARE) * _axial(shape, changing))
    # In shift numbers: that is where the matching errs.
    per_mm = _shift_per_mm(depth)
    shift = depth_to_shift(np.maximum(depth, 1)) + noise * sigma * per_mm
    out = quantize(shift)

    chance = 0.8 * _field(shape, 2.0, steady) + 0.6 * _field(shape, 1.0, changing)
    low, high = _GRAZING
    grazing = slant < low + (high - low) * _uniform(chance)
    missing = _nearest(hole_share, u, v) > _uniform(chance)
    out[~lit | grazing | missing | (depth <= 0)] = 0
    return out


def _jittered(
    view: DepthView, shape: tuple[int, int], steady: np.random.Generator,
    changing: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Give where on the supersampled grid each pixel really looks."""
    v, u = np.mgrid[:shape[0], :shape[1]].astype(np.float32)
    edge = _nearest(_broken(view, SUPERSAMPLING * _EDGE_REACH_PX).astype(np.uint8),
                    *_on_grid(u, v)) > 0
    moved = []
    for place in (u, v):
        jitter = _JITTER_PX * (0.8 * _field(shape, _JITTER_CORRELATION_PX, steady)
                               + 0.6 * _field(shape, _JITTER_CORRELATION_PX, changing))
        blocks = _EDGE_PX * (0.9 * _field(shape, _EDGE_CORRELATION_PX, steady)
                             + 0.44 * _field(shape, _EDGE_CORRELATION_PX, changing))
        moved.append(place + jitter + edge * blocks)
    return _on_grid(moved[0], moved[1])


def _on_grid(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Take pixels of the depth image to the supersampled grid."""
    grid = [((place + 0.5) * SUPERSAMPLING - 0.5).astype(np.float32) for place in (u, v)]
    return grid[0], grid[1]


def _broken(view: DepthView, reach: int) -> NDArray[np.bool_]:
    """Say where samples within `reach` are not all on one surface."""
    kernel = np.ones((3, 3), np.uint8)
    step = cv2.dilate(view.depth, kernel) - cv2.erode(view.depth, kernel)
    broken = (step > _CONTINUOUS * view.depth).astype(np.uint8)
    if reach > 1:
        broken = np.asarray(cv2.dilate(broken, np.ones((2 * reach - 1, 2 * reach - 1), np.uint8)))
    return broken > 0


def _look_up(view: DepthView, u: Floats, v: Floats) -> Floats:
    """Sample the depth bilinearly on surfaces, nearest across their edges: no flying pixels."""
    smooth = cv2.remap(view.depth, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    nearest = _nearest(view.depth, u, v)
    broken = _nearest(_broken(view, 1).astype(np.uint8), u, v) > 0
    return np.where(broken, nearest, smooth).astype(np.float32)


def _nearest(image: NDArray[np.generic], u: Floats, v: Floats) -> Floats:
    return np.asarray(cv2.remap(np.ascontiguousarray(image), u, v, cv2.INTER_NEAREST,
                                borderMode=cv2.BORDER_REPLICATE), np.float32)


def _axial(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    mixed = np.zeros(shape, np.float32)
    for share, length in _AXIAL:
        mixed += np.float32(np.sqrt(share)) * _field(shape, length, rng)
    return mixed


def _shift_per_mm(depth: Floats) -> NDArray[np.float64]:
    z = np.maximum(depth.astype(np.float64), 1)
    return depth_to_shift(z + 0.5) - depth_to_shift(z - 0.5)


def _field(shape: tuple[int, int], sigma: float, rng: np.random.Generator) -> Floats:
    """Make a smooth normal random field of unit variance."""
    white = rng.standard_normal(shape, dtype=np.float32)
    if sigma <= 0:
        return white
    smooth = cv2.GaussianBlur(white, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
    kernel = cv2.getGaussianKernel(int(8 * sigma) | 1, sigma)
    return np.asarray(smooth / float((kernel**2).sum()), np.float32)


def _uniform(field: Floats) -> Floats:
    """Turn a normal field into one that is uniform on 0-1 (logistic approximation)."""
    return np.asarray(1 / (1 + np.exp(-1.702 * field)), np.float32)
