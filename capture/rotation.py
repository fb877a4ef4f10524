"""Turning a frame by quarters, as of a sensor on its side or upside down, geometry included."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame

__all__ = ["ROTATIONS", "rotate_frame"]

ROTATIONS = (0, 90, 180, 270)
"""Degrees, clockwise as seen in the image."""


def rotate_frame(frame: RgbdFrame, degrees: int) -> RgbdFrame:
    """Turn both images clockwise, and the cameras with them.

    The turned frame is as exact as the frame: the point that a pixel shows is the same but for the
    turn about the camera's axis. What was above an upright sensor's image is above again.

    Raises
    ------
    ValueError
        `degrees` is none of `ROTATIONS`.
    """
    if degrees not in ROTATIONS:
        raise ValueError(f"rotation must be one of {ROTATIONS}, got {degrees}")
    if degrees == 0:
        return frame
    quarters = degrees // 90
    return replace(
        frame, depth=np.ascontiguousarray(np.rot90(frame.depth, -quarters)),
        color=frame.color if frame.color is None else np.ascontiguousarray(
            np.rot90(frame.color, -quarters)),
        calibration=_rotated(frame.calibration, quarters))


def _rotated(calibration: Calibration, quarters: int) -> Calibration:
    depth, color, pose = (calibration.depth, calibration.color, calibration.depth_to_color)
    turn = np.linalg.matrix_power(np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1))), quarters)
    for _ in range(quarters):
        depth, color = _quarter(depth), _quarter(color)
    rotation: NDArray[np.float64] = turn @ np.array(pose.rotation) @ turn.T
    return Calibration(depth=depth, color=color, depth_to_color=DepthToColor.model_validate(
        {"rotation": rotation.tolist(),
         "translation_mm": (turn @ np.array(pose.translation_mm)).tolist()}))


def _quarter(camera: CameraModel) -> CameraModel:
    """Turn a camera clockwise once: what was at (u, v) is at (height - 1 - v, u)."""
    k1, k2, p1, p2, k3 = camera.distortion
    # The tangential distortion is r^2 p + 2 (p . x) x with p = (p2, p1), which turns as x does.
    return CameraModel(
        width=camera.height, height=camera.width, fx=camera.fy, fy=camera.fx,
        cx=camera.height - 1 - camera.cy, cy=camera.cx, distortion=(k1, k2, p2, -p1, k3))
