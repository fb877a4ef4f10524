"""Registrations and seeds of simple shapes, made without rendering."""

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import DepthToColor
from denseface.recon.detail import add_detail
from denseface.recon.face import Seeds
from denseface.recon.intermediate import Registration, SurfaceGrid
from denseface.recon.noise import Noise, least_risk
from denseface.recon.registration import register
from denseface.recon.support import Support
from denseface.recon.surface import Surface, fit_surface
from tests.unit.frames import calibration, camera, frame

FOCAL = 300.0
WIDTH, HEIGHT = 320, 240
CAMERA = camera(WIDTH, HEIGHT, FOCAL)
# A head's half axes, mm: its front is rounder than its back is deep.
HEAD = (75.0, 105.0, 95.0)
NEAR = 700.0


def grid() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Each pixel's ray at z = 1, (x, y), both (H, W)."""
    rays = CAMERA.rays()
    return rays[..., 0], rays[..., 1]


def ellipsoid(
    x: float = 0.0, y: float = 0.0, front: float = NEAR, axes: tuple[float, ...] = HEAD
) -> NDArray[np.float64]:
    """Depth of an ellipsoid whose front is at (x, y, front), (H, W) mm, inf beside it."""
    center = np.array([x, y, front + axes[2]]) / axes
    ray = np.stack([*grid(), np.ones((HEIGHT, WIDTH))], axis=-1) / axes
    a, b, c = (ray**2).sum(-1), ray @ center, center @ center - 1
    inside = b * b - a * c
    return np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)


def registration(
    depth: NDArray[np.float64], color: NDArray[np.uint8] | None = None, baseline_mm: float = 0.0
) -> Registration:
    """Tie (H, W) depths, mm, inf where nothing, to a colour camera like the depth camera."""
    if color is None:
        color = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    calib = calibration(depth=CAMERA, color=CAMERA,
                        depth_to_color=DepthToColor(translation_mm=(baseline_mm, 0, 0)))
    readings = np.where(np.isfinite(depth), np.rint(depth), 0).astype(np.uint16)
    return register(frame(readings, color, calib))


def box(x: float = 0.0, y: float = 0.0, z: float = NEAR, width_mm: float = 150.0) -> tuple[
        int, int, int, int]:
    """The detector's box around a head at (x, y, z) mm."""
    u, v = CAMERA.project(np.array([x, y, z]))
    side = round(width_mm * FOCAL / z)
    return round(u - side / 2), round(v - side / 2), side, side


NOISE = Noise(white_mm=1.2, smooth_mm=0.0, length_px=2.0, quantum_mm=0.0)
"""White, of 1.2 mm."""


def disc_seeds(
    spacing: float, radius: float, hole: float = 0.0, *, seed: int = 0, jitter: float = 0.1
) -> NDArray[np.float32]:
    """A lattice of points over a disc with a hole in its middle, (n, 3) float32 mm, z = 0."""
    count = int(np.ceil(radius / spacing)) + 1
    axis = float(spacing) * np.arange(-count, count + 1)
    xy = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    xy += np.random.default_rng(seed).uniform(-jitter, jitter, xy.shape) * spacing
    far = np.hypot(*xy.T)
    xy = xy[(far <= radius) & (far >= hole)]
    return np.column_stack([xy, np.zeros(len(xy))]).astype(np.float32)


def seeds(points: NDArray[np.float32], colors: NDArray[np.uint8] | None = None) -> Seeds:
    """Give points as seeds, gray where no colours are given."""
    if colors is None:
        colors = np.full((len(points), 3), 128, np.uint8)
    return Seeds(points, colors, np.zeros((len(points), 2), np.int32))


def fitted(
    points: NDArray[np.float32], spacing: float, r0: float, smoothing: float
) -> SurfaceGrid:
    """A fit without detail, on the support of its points."""
    return fit_surface(points, r0, smoothing).on_support(Support.of(points, spacing))


def with_detail(
    broad: Surface, points: NDArray[np.float32], spacing: float, radius: float, *,
    symmetry: bool = False, noise: Noise = NOISE,
) -> SurfaceGrid:
    """A fit of some points with their detail."""
    support = Support.of(points, spacing)
    plan = least_risk(noise, spacing, radius / spacing)
    return add_detail(broad.heights(support.xs, support.ys), support, points, spacing, radius,
                      plan, symmetry=symmetry)
