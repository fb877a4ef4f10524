"""The factory calibration that an Orbbec sensor keeps, checked before it is believed.

It is a property of the device (`OBCameraParams` of Orbbec's OpenNI2): 30 floats, little-endian,
for images of 640 columns; then an integer that says whether the images were mirrored, which
Orbbec's own ROS node does not read either. A sensor that was never calibrated answers NaN.
"""

import math
import struct

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

VENDOR = 0x2BC5
"""USB vendor."""
PROPERTY = 14
"""Number of the device's property."""
PROPERTY_BYTES = (124, 120, 128)
"""Sizes that the property was seen to have in public headers: a driver answers to its own alone."""

_LAYOUT = struct.Struct("<30f")
"""Depth camera fx, fy, cx, cy; colour camera the same; rotation, row by row, and translation, mm,
from the depth camera's frame to the colour camera's; then k1, k2, k3, p1, p2 of both."""
_COLUMNS = 640
_HEIGHTS = (480, 400)
"""Rows of the images that it may be for: which, is not said, but shows in the principal point."""
_FOV_TANGENT = (0.25, 1.2)
"""Half of the image by the focal length: fields of view of 28 to 100 degrees."""
_ASPECT = 0.05
"""How far fx and fy may differ, by fx."""
_OFF_CENTER = 0.15
"""How far the principal point may be from the image's middle, by the image's side."""
_TURN_DEG = 10.0
"""Between both cameras: they are mounted side by side."""
_APART_MM = (5.0, 150.0)
"""Between both cameras; in metres it would be less."""
_TANGENTIAL = 0.05
"""The largest p1 or p2; in another order k3 would be here."""
_ORTHONORMAL = 1e-2
"""Largest entry of R R^T - I before R is made a rotation."""


def unpack(content: bytes) -> tuple[float, ...] | None:
    """Take the floats out of the property; None where they are too few."""
    return _LAYOUT.unpack_from(content) if len(content) >= _LAYOUT.size else None


def believable(
    values: tuple[float, ...], depth_size: tuple[int, int], color_size: tuple[int, int] | None
) -> tuple[Calibration | None, str]:
    """Give the calibration for two modes, or None, and in words where it is from or what is wrong.

    values : as `unpack` gives them
    """
    try:
        depth = _camera("depth", values[0:4], values[20:25])
        color = _camera("color", values[4:8], values[25:30])
        pose = _pose(values[8:17], values[17:20])
        depth = depth.cut_to(*depth_size)
        if color_size is None:
            return Calibration(depth=depth, color=depth), "Orbbec factory calibration"
        return (Calibration(depth=depth, color=color.cut_to(*color_size), depth_to_color=pose),
                "Orbbec factory calibration")
    except ValueError as error:
        reason = str(error)
    return None, f"Orbbec factory calibration not believed: {reason}"


def _camera(name: str, intrinsics: tuple[float, ...], k: tuple[float, ...]) -> CameraModel:
    fx, fy, cx, cy = intrinsics
    if not all(math.isfinite(value) for value in (*intrinsics, *k)):
        raise ValueError(f"{name} camera has no numbers")
    if fx <= 0 or not _FOV_TANGENT[0] <= _COLUMNS / 2 / fx <= _FOV_TANGENT[1]:
        raise ValueError(f"{name} camera has f {fx:.6g} for {_COLUMNS} columns")
    if abs(fy / fx - 1) > _ASPECT:
        raise ValueError(f"{name} camera has fx {fx:.6g} and fy {fy:.6g}")
    height = min(_HEIGHTS, key=lambda rows: abs((rows - 1) / 2 - cy))
    if (abs(cx - (_COLUMNS - 1) / 2) > _OFF_CENTER * _COLUMNS
            or abs(cy - (height - 1) / 2) > _OFF_CENTER * height):
        raise ValueError(f"{name} camera has its center at {cx:.6g}, {cy:.6g}")
    k1, k2, k3, p1, p2 = k
    if max(abs(p1), abs(p2)) > _TANGENTIAL:
        raise ValueError(f"{name} camera has a distortion p1 {p1:.6g}, p2 {p2:.6g}")
    return CameraModel(width=_COLUMNS, height=height, fx=fx, fy=fy, cx=cx, cy=cy,
                       distortion=(k1, k2, p1, p2, k3))


def _pose(rotation: tuple[float, ...], translation: tuple[float, ...]) -> DepthToColor:
    if not all(math.isfinite(value) for value in (*rotation, *translation)):
        raise ValueError("the cameras' pose has no numbers")
    R = np.reshape(rotation, (3, 3)).astype(np.float64)
    if np.abs(R @ R.T - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(R) < 0:
        raise ValueError("the cameras' pose is no rotation")
    turn = math.degrees(math.acos(np.clip((np.trace(R) - 1) / 2, -1, 1)))
    apart = float(np.linalg.norm(translation))
    if turn > _TURN_DEG:
        raise ValueError(f"the cameras are turned by {turn:.1f} degrees")
    if not _APART_MM[0] <= apart <= _APART_MM[1]:
        raise ValueError(f"the cameras are {apart:.3g} mm apart")
    return DepthToColor(rotation=_rows(_nearest_rotation(R)),
                        translation_mm=(translation[0], translation[1], translation[2]))


def _nearest_rotation(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Undo what rounding to float32 did."""
    u, _, vt = np.linalg.svd(R)
    nearest: NDArray[np.float64] = u @ vt
    return nearest


def _rows(R: NDArray[np.float64]) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(a), float(b), float(c)) for a, b, c in R)
