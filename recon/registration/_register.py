"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from functools import lru_cache

import cv2
import numpy as np

from denseface.capture.calibration import CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.errors import NoDepthError
from denseface.recon.intermediate import NO_DEPTH_MM, Registration, ZBuffer
from denseface.recon.registration import _kernels as kernels
from denseface.recon.registration._kernels import ColorCamera, PixelGrid, Projected

_ALL = slice(None)
_NO_LIMIT = int(np.iinfo(np.uint16).max)
"""Largest number of a depth."""


def register(
    frame: RgbdFrame, rows: slice = _ALL, columns: slice = _ALL, *, colors: bool = True,
) -> Registration:
    """Tie depth to colour through both cameras' intrinsics, distortion and relative pose.

    Points are back-projected by Eq. (1), moved to the colour camera and projected there; a
    z-buffer in the colour image finds those that the colour camera cannot see.

    Parameters
    ----------
    frame : depth, in its own unit, and colour with their calibration; without colour, the depth
        is tied to the colour camera that the calibration describes, and `colors` must be False
    rows, columns : the part of the depth image to register, every pixel or every k-th
    colors : whether to sample them; zero otherwise

    Raises
    ------
    NoDepthError
        Where no pixel has a depth.
    """
    depth = np.array(frame.depth[rows, columns])
    meaning = frame.depth_meaning
    if meaning.max_count < _NO_LIMIT:
        depth[depth > meaning.max_count] = 0
    valid = depth > 0
    if not valid.any():
        raise NoDepthError("the depth image is empty: every pixel is 0 (no reading)")
    out = Projected(np.zeros((*depth.shape, 3), np.float32),
                    np.full((*depth.shape, 2), np.nan, np.float32),
                    np.zeros(depth.shape, np.float32))
    (first_row, _, row_step), (first_column, _, column_step) = (
        part.indices(side) for part, side in zip((rows, columns), frame.depth.shape, strict=True))
    grid = PixelGrid(*_rays(frame.depth_camera), (first_row, first_column), (row_step, column_step))
    camera = _color_camera(frame)
    pitch = max(1.0, camera.intrinsics[0] / frame.depth_camera.fx * row_step)
    cells = [int(np.ceil(side / pitch)) + 1 for side in reversed(camera.size)]
    nearest = np.full(cells, NO_DEPTH_MM)
    z_buffer = ZBuffer(nearest, pitch)
    top, bottom, left, right = kernels.project(
        depth, (meaning.unit_um / 1000, meaning.offset_mm), grid, camera, out, z_buffer)
    # Each point covers about its cell and the next: without this, a far surface would shine
    # through between the samples of a near one.
    if bottom >= 0:
        part = (slice(max(top - 1, 0), bottom + 2), slice(max(left - 1, 0), right + 2))
        nearest[part] = cv2.erode(nearest[part], np.ones((3, 3), np.uint8))
    visible = kernels.visible_mask(out.pixels, out.color_depth, z_buffer, camera.size)
    sampled = (kernels.sample_image(out.pixels, visible, _read_only(frame.rgb)) if colors
               else np.zeros((*depth.shape, 3), np.uint8))
    return Registration(rows, columns, frame.depth_camera.fx, out.points, valid, out.pixels,
                        out.color_depth, visible, sampled, z_buffer)


def sample_colors(
    frame: RgbdFrame, registered: Registration, points: Floats
) -> tuple[Bytes, Bools]:
    """Sample the colour image at any points, as if they had been measured.

    Parameters
    ----------
    frame : that of `registered`
    registered : what may hide the points
    points : (n, 3) float32, mm, depth camera frame

    Returns
    -------
    colors : (n, 3) uint8, RGB, bilinear; zero where not `visible`
    visible : (n,) bool, inside the colour image and hidden by nothing registered
    """
    camera = _color_camera(frame)
    out = Projected(np.ascontiguousarray(points)[None], np.empty((1, len(points), 2), np.float32),
                    np.empty((1, len(points)), np.float32))
    kernels.project_points(out, camera)
    visible = kernels.visible_mask(out.pixels, out.color_depth, registered.z_buffer, camera.size)
    return kernels.sample_image(out.pixels, visible, _read_only(frame.rgb))[0], visible[0]


def _rays(camera: CameraModel) -> tuple[Doubles, Doubles]:
    """Give x and y at z = 1 of each pixel, read-only.

    Without distortion they are broadcast from one row and one column, which stay in the cache.
    """
    if any(camera.distortion):
        rays = camera.rays()
        return rays[..., 0], rays[..., 1]
    return _straight_rays(camera)


@lru_cache(maxsize=8)
def _straight_rays(camera: CameraModel) -> tuple[Doubles, Doubles]:
    columns, rows = np.arange(camera.width), np.arange(camera.height)
    x = camera.back_project(np.stack([columns, np.zeros_like(columns)], axis=-1), 1.0)[:, 0]
    y = camera.back_project(np.stack([np.zeros_like(rows), rows], axis=-1), 1.0)[:, 1:2]
    shape = camera.height, camera.width
    return np.broadcast_to(x.copy(), shape), np.broadcast_to(y, shape)


def _color_camera(frame: RgbdFrame) -> ColorCamera:
    return _posed(frame.calibration.color, frame.depth_to_color)


@lru_cache(maxsize=8)
def _posed(camera: CameraModel, pose: DepthToColor) -> ColorCamera:
    return ColorCamera(
        tuple(float(number) for row in pose.rotation for number in row),
        tuple(map(float, pose.translation_mm)), (float(camera.width), float(camera.height)),
        tuple(map(float, (camera.fx, camera.fy, camera.cx, camera.cy))), camera.distortion)


def _read_only(image: Bytes) -> Bytes:
    """Give the same image, contiguous and read-only: loops are compiled for that type alone."""
    same = np.ascontiguousarray(image).view()
    same.setflags(write=False)
    return same
