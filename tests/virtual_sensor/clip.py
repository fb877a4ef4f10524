"""What the virtual sensor shows: the frame file that its driver plays (little-endian).

====== ==========================================================================================
bytes  what
====== ==========================================================================================
8      ``VSENSOR2``
4 x 4  uint32 version (2), number of frames, width, height
8      uint64 zero plane distance (ZPD), mm
8 x 3  float64 zero plane pixel size (ZPPS), mm; emitter to depth camera (LDDIS), cm;
       depth to colour camera (DCRCDIS), cm
4 x 4  float32 field of view, radians: depth horizontal, vertical, colour horizontal, vertical
8 x 30 float64 the true geometry: depth camera and colour camera (fx, fy, cx, cy, pixels; k1, k2,
       p1, p2, k3), rotation (by rows) and translation (mm), depth camera's frame to colour's
rest   for each frame the depth image, uint16 mm, then the colour image, uint8 RGB
====== ==========================================================================================
"""

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

__all__ = ["write_clip"]

_ZPPS_COLUMNS = 1280
"""Columns of the image whose pixels ZPPS is given in."""
_HEADER = struct.Struct("<8s4IQ3d4f30d")


def write_clip(
    path: Path,
    frames: Sequence[tuple[NDArray[np.uint16], NDArray[np.uint8]]],
    *,
    zpd_mm: int = 120,
    zpps_mm: float = 0.1042,
    lddis_cm: float = 7.5,
    dcrcdis_cm: float = 2.3,
    depth_fov: tuple[float, float] = (1.0144686, 0.7898094),
    color_fov: tuple[float, float] = (2 * math.atan(320 / 525), 2 * math.atan(240 / 525)),
    calibration: Calibration | None = None,
) -> None:
    """Write the frame file of the virtual sensor.

    Parameters
    ----------
    frames : (depth (H, W) uint16 mm, color (H, W, 3) uint8 RGB) pairs, all of one size
    zpd_mm, zpps_mm, lddis_cm, dcrcdis_cm : what the depth stream says of itself
    depth_fov, color_fov : horizontal and vertical field of view, radians
    calibration : the true geometry, with which the sensor registers depth to colour; by default
        what the other arguments say
    """
    height, width = frames[0][0].shape
    if calibration is None:
        calibration = Calibration(
            depth=_pinhole(width, height, zpd_mm / zpps_mm * width / _ZPPS_COLUMNS),
            color=_pinhole(width, height, width / 2 / math.tan(color_fov[0] / 2)),
            depth_to_color=DepthToColor(translation_mm=(-10 * dcrcdis_cm, 0, 0)))
    # Written aside: a driver that has the old one mapped goes on with it.
    aside = path.with_name(f"{path.name}.part")
    with aside.open("wb") as file:
        file.write(_HEADER.pack(b"VSENSOR2", 2, len(frames), width, height, zpd_mm, zpps_mm,
                                lddis_cm, dcrcdis_cm, *depth_fov, *color_fov,
                                *_geometry(calibration)))
        for depth, color in frames:
            if depth.shape != (height, width) or color.shape != (height, width, 3):
                raise ValueError(f"frames must all be {width}x{height}, got depth {depth.shape} "
                                 f"and color {color.shape}")
            file.write(np.ascontiguousarray(depth, "<u2").tobytes())
            file.write(np.ascontiguousarray(color, np.uint8).tobytes())
    aside.replace(path)


def _geometry(calibration: Calibration) -> list[float]:
    color = calibration.color or calibration.depth
    pose = calibration.depth_to_color
    return [*_camera(calibration.depth), *_camera(color), *np.ravel(pose.rotation),
            *pose.translation_mm]


def _pinhole(width: int, height: int, focal: float) -> CameraModel:
    return CameraModel(width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2,
                       cy=(height - 1) / 2)


def _camera(camera: CameraModel) -> list[float]:
    return [camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion]
