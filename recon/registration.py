"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.frame import RgbdFrame
from recon.errors import NoDepthError

__all__ = ["Registration", "register"]

# A point is hidden when another, nearer one falls on the same spot of the colour image. A steep
# surface differs by a few millimetres from spot to spot without hiding itself.
_HIDDEN_MM = 15.0
_HIDDEN_SHARE = 0.02

_ALL = slice(None)


@dataclass(frozen=True, eq=False)
class Registration:
    """A part of the depth image as points, tied to the colour image; an entry for each pixel.

    Attributes
    ----------
    rows, columns : which rows and columns of the depth image these (H, W) are
    focal_px : focal length of the depth camera, in pixels of the depth image
    points : (H, W, 3) float32, mm, depth camera frame; zero where nothing was measured
    valid : (H, W) bool, a depth was measured
    pixels : (H, W, 2) float32, (u, v) in the colour image; NaN where not `valid`
    color_depth : (H, W) float32, mm, z in the colour camera's frame; zero where not `valid`
    visible : (H, W) bool, inside the colour image and not hidden by a nearer surface
    colors : (H, W, 3) uint8, RGB, bilinear; zero where not `visible`
    """

    rows: slice
    columns: slice
    focal_px: float
    points: NDArray[np.float32]
    valid: NDArray[np.bool_]
    pixels: NDArray[np.float32]
    color_depth: NDArray[np.float32]
    visible: NDArray[np.bool_]
    colors: NDArray[np.uint8]


def register(
    frame: RgbdFrame,
    depth_offset_mm: float = 0.0,
    rows: slice = _ALL,
    columns: slice = _ALL,
) -> Registration:
    """Tie depth to colour through both cameras' intrinsics, distortion and relative pose.

    Points are back-projected by Eq. (1), moved to the colour camera and projected there; a
    z-buffer in the colour image finds those that the colour camera cannot see.

    Parameters
    ----------
    frame : depth, mm, and colour with their calibration
    depth_offset_mm : added to each depth, mm
    rows, columns : the part of the depth image to register, every pixel or every k-th

    Raises
    ------
    NoDepthError
        Where no pixel has a depth.
    """
    depth = frame.depth[rows, columns]
    valid = depth > 0
    if not valid.any():
        raise NoDepthError("the depth image is empty: every pixel is 0 (no reading)")
    z = np.where(valid, depth + np.float32(depth_offset_mm), np.float32(0))
    points = np.empty((*depth.shape, 3), np.float32)
    np.multiply(frame.depth_camera.rays()[rows, columns], z[..., None], out=points[..., :2])
    points[..., 2] = z
    moved = frame.depth_to_color.apply(points.reshape(-1, 3)).reshape(points.shape)
    color_z = moved[..., 2]
    color_z[~valid | (color_z <= 0)] = np.nan  # and so is all that follows from it
    color_camera = frame.calibration.color
    pixels = color_camera.project(moved).astype(np.float32)
    u, v = pixels[..., 0], pixels[..., 1]
    inside = ((u > -0.5) & (u < color_camera.width - 0.5)
              & (v > -0.5) & (v < color_camera.height - 0.5))
    pitch = max(1.0, color_camera.fx / frame.depth_camera.fx * (rows.step or 1))
    visible = inside
    visible[inside] = _unhidden(u[inside], v[inside], color_z[inside].astype(np.float32), pitch,
                                (color_camera.height, color_camera.width))
    colors = np.asarray(cv2.remap(
        frame.color, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
    colors[~visible] = 0
    return Registration(
        rows=rows,
        columns=columns,
        focal_px=frame.depth_camera.fx,
        points=points,
        valid=valid,
        pixels=pixels,
        color_depth=np.nan_to_num(color_z.astype(np.float32)),
        visible=visible,
        colors=colors,
    )


def _unhidden(
    u: NDArray[np.float32], v: NDArray[np.float32], z: NDArray[np.float32], pitch: float,
    shape: tuple[int, int],
) -> NDArray[np.bool_]:
    """Say which points no nearer one hides, by a z-buffer with cells of one depth pixel's size."""
    row, column = (((one + np.float32(0.5)) / np.float32(pitch)).astype(np.intp) for one in (v, u))
    rows, columns = (int(np.ceil(side / pitch)) + 1 for side in shape)
    flat = row * columns + column
    nearest = np.full(rows * columns, np.inf, np.float32)
    np.minimum.at(nearest, flat, z)
    # Each point covers about its cell and the next: without this, a far surface would shine
    # through between the samples of a near one.
    covered = cv2.erode(nearest.reshape(rows, columns), np.ones((3, 3), np.uint8)).ravel()
    unhidden: NDArray[np.bool_] = z <= covered[flat] + np.maximum(
        np.float32(_HIDDEN_MM), np.float32(_HIDDEN_SHARE) * z)
    return unhidden
