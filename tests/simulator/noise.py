"""How a sensor's depth differs from the truth.

Lateral jitter: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D
reconstruction and tracking", 3DIMPVT 2012. Axial noise and its correlation: fitted to a real
Kinect recording (standard deviation over time by distance, correlation between neighbours).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulator.camera_views import SUPERSAMPLING, DepthView
from tests.simulator.depth_noise import KINECT_V1, DepthNoise, Edges, Levels
from tests.simulator.shift import depth_to_shift, quantize

__all__ = ["noisy_depth"]

Floats = NDArray[np.float32]

_CONTINUOUS = 0.012
"""Neighbouring samples farther apart than this share of the depth are not one surface."""
_MIXING = 3
"""Side of the square of supersampled pixels whose depths a pixel of `Edges.MIXED` mixes."""

def noisy_depth(
    view: DepthView, hole_share: Floats, steady: np.random.Generator,
    changing: np.random.Generator, noise: DepthNoise = KINECT_V1,
) -> NDArray[np.uint16]:
    """Make one depth image, (H, W) uint16 counts, of a true view.

    Parameters
    ----------
    view : the truth, supersampled
    hole_share : (H, W) float32, 0-1, supersampled: how likely there is no reading
    steady : what is the same in each frame of a still scene; give it afresh for each frame
    changing : what differs between frames
    noise : of the kind of sensor
    """
    height = view.camera.height // SUPERSAMPLING
    width = view.camera.width // SUPERSAMPLING
    shape = (height, width)
    u, v = _jittered(view, shape, steady, changing, noise)
    depth = _look_up(view, u, v, mixed=noise.edges is Edges.MIXED)
    slant = _nearest(view.slant, u, v)
    lit = _nearest(view.lit.astype(np.uint8), u, v) > 0

    error = (np.sqrt(noise.steady_share) * _axial(shape, steady, noise)
             + np.sqrt(1 - noise.steady_share) * _axial(shape, changing, noise))
    error = error * noise.axial_mm(np.maximum(depth, 1))
    if noise.levels is Levels.SHIFT:
        # In shift numbers: that is where the matching errs.
        out = quantize(depth_to_shift(np.maximum(depth, 1)) + error * _shift_per_mm(depth))
    else:
        out = np.clip(noise.to_counts(depth + error), 0, 65535).astype(np.uint16)

    chance = 0.8 * _field(shape, 2.0, steady) + 0.6 * _field(shape, 1.0, changing)
    low, high = noise.grazing
    grazing = slant < low + (high - low) * _uniform(chance)
    missing = _nearest(hole_share, u, v) > _uniform(chance)
    unlit = ~lit if noise.shadows else np.zeros_like(lit)
    out[unlit | grazing | missing | (depth <= 0)] = 0
    return out


def _jittered(
    view: DepthView, shape: tuple[int, int], steady: np.random.Generator,
    changing: np.random.Generator, noise: DepthNoise,
) -> tuple[Floats, Floats]:
    """Give where on the supersampled grid each pixel really looks."""
    v, u = np.mgrid[:shape[0], :shape[1]].astype(np.float32)
    edge = _nearest(_broken(view, SUPERSAMPLING * noise.edge_reach_px).astype(np.uint8),
                    *_on_grid(u, v)) > 0
    apart, size = noise.jitter_correlation_px, noise.edge_correlation_px
    moved = []
    for place in (u, v):
        place = place + noise.jitter_px * (
            0.8 * _field(shape, apart, steady) + 0.6 * _field(shape, apart, changing))
        if noise.edges is Edges.BLOCKS:
            blocks = noise.edge_px * (
                0.9 * _field(shape, size, steady) + 0.44 * _field(shape, size, changing))
            place = place + edge * blocks
        moved.append(place)
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


def _look_up(view: DepthView, u: Floats, v: Floats, *, mixed: bool) -> Floats:
    """Sample the depth bilinearly on surfaces; across their edges nearest, or mixed."""
    if mixed:
        wide = cv2.blur(view.depth, (_MIXING, _MIXING))
        return np.asarray(
            cv2.remap(wide, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
    smooth = cv2.remap(view.depth, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    nearest = _nearest(view.depth, u, v)
    broken = _nearest(_broken(view, 1).astype(np.uint8), u, v) > 0
    return np.where(broken, nearest, smooth).astype(np.float32)


def _nearest(image: NDArray[np.generic], u: Floats, v: Floats) -> Floats:
    return np.asarray(cv2.remap(np.ascontiguousarray(image), u, v, cv2.INTER_NEAREST,
                                borderMode=cv2.BORDER_REPLICATE), np.float32)


def _axial(shape: tuple[int, int], rng: np.random.Generator, noise: DepthNoise) -> Floats:
    mixed = np.zeros(shape, np.float32)
    for share, length in noise.spectrum:
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
