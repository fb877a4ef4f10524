"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.recon.errors import NoDepthError
from denseface.recon.intermediate import Registration
from denseface.recon.registration._kernels import (
    EMPTY,
    project,
    project_points,
    sample_image,
    visible_mask,
)

__all__ = ["register", "sample_colors"]

# A point is hidden when another, nearer one falls on the same spot of the colour image. A steep
# surface differs by a few millimetres from spot to spot without hiding itself.
_HIDDEN_MM = 15.0
_HIDDEN_SHARE = 0.02

_ALL = slice(None)


def register(
    frame: RgbdFrame,
    depth_offset_mm: float = 0.0,
    rows: slice = _ALL,
    columns: slice = _ALL,
    *,
    colors: bool = True,
) -> Registration:
    """Tie depth to colour through both cameras' intrinsics, distortion and relative pose.

    Points are back-projected by Eq. (1), moved to the colour camera and projected there; a
    z-buffer in the colour image finds those that the colour camera cannot see.

    Parameters
    ----------
    frame : depth, mm, and colour with their calibration
    depth_offset_mm : added to each depth, mm
    rows, columns : the part of the depth image to register, every pixel or every k-th
    colors : whether to look them up; zero otherwise

    Raises
    ------
    NoDepthError
        Where no pixel has a depth.
    """
    depth = np.array(frame.depth[rows, columns])
    valid = depth > 0
    if not valid.any():
        raise NoDepthError("the depth image is empty: every pixel is 0 (no reading)")
    points = np.zeros((*depth.shape, 3), np.float32)
    pixels = np.full((*depth.shape, 2), np.nan, np.float32)
    color_depth = np.zeros(depth.shape, np.float32)
    (first_row, _, row_step), (first_column, _, column_step) = (
        part.indices(side) for part, side in zip((rows, columns), frame.depth.shape, strict=True))
    camera = frame.calibration.color
    pitch = max(1.0, camera.fx / frame.depth_camera.fx * row_step)
    height, width = frame.color.shape[:2]
    nearest = np.full([int(np.ceil(side / pitch)) + 1 for side in (height, width)], EMPTY)
    top, bottom, left, right = project(
        depth, depth_offset_mm, _rays(frame.depth_camera), (first_row, first_column),
        (row_step, column_step), *_pose(frame), pitch, points, pixels, color_depth, nearest)
    # Each point covers about its cell and the next: without this, a far surface would shine
    # through between the samples of a near one.
    if bottom >= 0:
        part = (slice(max(top - 1, 0), bottom + 2), slice(max(left - 1, 0), right + 2))
        nearest[part] = cv2.erode(nearest[part], np.ones((3, 3), np.uint8))
    visible = visible_mask(pixels, color_depth, nearest, pitch, _HIDDEN_MM, _HIDDEN_SHARE, width,
                           height)
    seen = sample_image(pixels, visible, _read_only(frame.color)) if colors else np.zeros(
        (*depth.shape, 3), np.uint8)
    return Registration(
        rows=rows,
        columns=columns,
        focal_px=frame.depth_camera.fx,
        points=points,
        valid=valid,
        pixels=pixels,
        color_depth=color_depth,
        visible=visible,
        colors=seen,
        pitch=pitch,
        nearest=nearest,
    )


def sample_colors(
    frame: RgbdFrame, registered: Registration, points: NDArray[np.float32]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Look any points' colours up in the colour image, as if they had been measured.

    Parameters
    ----------
    frame : that of `registered`
    registered : what may hide the points
    points : (n, 3) float32, mm, depth camera frame

    Returns
    -------
    colors : (n, 3) uint8, RGB, bilinear; zero where not `seen`
    seen : (n,) bool, inside the colour image and hidden by nothing registered
    """
    pixels = np.empty((1, len(points), 2), np.float32)
    z = np.empty((1, len(points)), np.float32)
    project_points(np.ascontiguousarray(points)[None], *_pose(frame), pixels, z)
    height, width = frame.color.shape[:2]
    seen = visible_mask(pixels, z, registered.nearest, registered.pitch, _HIDDEN_MM, _HIDDEN_SHARE,
                        width, height)
    return sample_image(pixels, seen, _read_only(frame.color))[0], seen[0]


@lru_cache(maxsize=8)
def _rays(camera: CameraModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give x and y at z = 1 of each pixel, read-only.

    Without distortion x is that of the column and y that of the row: megabytes need not be read.
    """
    rays = camera.rays()
    if any(camera.distortion):
        return rays[..., 0], rays[..., 1]
    return (np.broadcast_to(rays[0, :, 0].copy(), rays.shape[:2]),
            np.broadcast_to(rays[:, :1, 1].copy(), rays.shape[:2]))


def _pose(
    frame: RgbdFrame,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Rotation, translation and intrinsics of the colour camera, as the loops take them."""
    camera, moved = frame.calibration.color, frame.depth_to_color
    return (np.array(moved.rotation, np.float64), np.array(moved.translation_mm, np.float64),
            np.array((camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
                      *camera.distortion), np.float64))


def _read_only(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The same image, of one kind whatever it was: a loop is compiled anew for each."""
    same = np.ascontiguousarray(image).view()
    same.setflags(write=False)
    return same
