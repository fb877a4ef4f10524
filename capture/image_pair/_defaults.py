"""Cameras of sensors whose calibration nobody gave: known by the sizes of their images.

None of these is a calibration: a focal length that is wrong by 5 % makes a face 5 % too narrow or
too wide. Who uses one is told.
"""

import math
from typing import NamedTuple

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

__all__ = ["DefaultCameras", "default_calibration"]

_Size = tuple[int, int]
_DEFAULT_FOV_DEG = 60.0
"""Horizontal field of view of a camera of which nothing is known: from 54 (Kinect v2's colour) to
90 (Azure Kinect's), 62 of a Kinect v1."""
_TILT_DEG = 6.0
"""How far an Azure Kinect's depth camera looks below its colour camera (its documentation,
"coordinate systems")."""
_TILT = (math.cos(math.radians(_TILT_DEG)), math.sin(math.radians(_TILT_DEG)))


class _Pair(NamedTuple):
    """A sensor's two cameras, before they are registered."""

    sensor: str
    depth: dict[_Size, tuple[float, float, float]]
    """Focal length and principal point by the depth image's size, pixels."""
    color: dict[_Size, float]
    """Focal length by the colour image's size, pixels."""
    pose: DepthToColor


_PAIRS = (
    # 52 mm between the cameras; focal lengths as libfreenect2 reads them from devices.
    _Pair("Kinect v2", {(512, 424): (365.5, 255.5, 211.5)}, {(1920, 1080): 1081.4},
          DepthToColor(translation_mm=(-52, 0, 0))),
    # Focal lengths as the SDK reads them from devices; the narrow field of view is a part of the
    # sensor's 1024 x 1024.
    _Pair("Azure Kinect", {(640, 576): (504, 324, 330), (320, 288): (252, 161.75, 164.75)},
          {(1280, 720): 604, (1920, 1080): 906, (2560, 1440): 1208, (3840, 2160): 1812},
          DepthToColor(rotation=((1, 0, 0), (0, _TILT[0], _TILT[1]), (0, -_TILT[1], _TILT[0])),
                       translation_mm=(-32, -2, 4))),
    # `rs-enumerate-devices -c` of D435s. VGA is cut out of the middle.
    _Pair("RealSense D400", {(848, 480): (425, 423.5, 239.5), (1280, 720): (640, 639.5, 359.5)},
          {(1280, 720): 918, (1920, 1080): 1377, (640, 480): 612, (960, 540): 688.5},
          DepthToColor(translation_mm=(15, 0, 0))),
    # As the OpenNI2 sources have it; 640 x 400 is Orbbec's, whose cameras are 25 mm apart.
    _Pair("Orbbec Astra", {(640, 400): (575, 319.5, 199.5)},
          {(640, 480): 525, (1280, 960): 1050}, DepthToColor(translation_mm=(-25, 0, 0))),
    _Pair("Kinect v1 or Xtion", {(640, 480): (575.8, 319.5, 239.5),
                                 (320, 240): (287.9, 159.5, 119.5)},
          {(640, 480): 525, (320, 240): 262.5, (1280, 1024): 1050, (1280, 960): 1050},
          DepthToColor(translation_mm=(-23, 0, 0))),
)
_REGISTERED = {(640, 480): (525.0, "Kinect v1 or Xtion"), (320, 240): (262.5, "Kinect v1 or Xtion"),
               (512, 424): (365.5, "Kinect v2"), (640, 576): (504.0, "Azure Kinect"),
               (848, 480): (612.0, "RealSense D400"), (1280, 720): (918.0, "RealSense D400"),
               (1920, 1080): (1081.4, "Kinect v2")}
"""Focal length of the one camera that both images are of, by their size."""


class DefaultCameras(NamedTuple):
    """Cameras that were taken for want of others."""

    calibration: Calibration
    words: str
    """Whose they are, and how they were chosen."""


def default_calibration(
    depth_size: _Size, color_size: _Size | None, registered: bool
) -> DefaultCameras:
    """Choose cameras by the images' sizes, (width, height) pixels.

    Where the depth is registered, the colour camera is what both images are of.
    """
    if color_size is None:
        focal, sensor = next(((pair.depth[depth_size][0], pair.sensor) for pair in _PAIRS
                              if depth_size in pair.depth), _REGISTERED.get(depth_size, (0.0, "")))
        camera = _centered(depth_size, focal or _unknown_focal(depth_size))
        return DefaultCameras(Calibration(depth=camera, color=camera), _words(camera, sensor))
    pair = next((pair for pair in _PAIRS if depth_size in pair.depth and color_size in pair.color),
                None)
    if registered:
        focal, sensor = _REGISTERED.get(color_size, (0.0, ""))
        camera = _centered(color_size, focal or _unknown_focal(color_size))
        if pair is None or depth_size != color_size:
            return DefaultCameras(Calibration(depth=camera, color=camera), _words(camera, sensor))
        # The depth camera is there for the case that the depth turns out not to be registered.
        return DefaultCameras(
            Calibration(depth=_depth_camera(pair, depth_size), color=camera,
                        depth_to_color=pair.pose), _words(camera, sensor))
    if pair is not None:
        color = _centered(color_size, pair.color[color_size])
        return DefaultCameras(
            Calibration(depth=_depth_camera(pair, depth_size), color=color,
                        depth_to_color=pair.pose),
            f"the cameras are taken for those of a {pair.sensor}, by the images' sizes")
    depth, color = (_centered(size, _unknown_focal(size)) for size in (depth_size, color_size))
    return DefaultCameras(
        Calibration(depth=depth, color=color),
        f"the cameras are taken to stand in one place and to see {_DEFAULT_FOV_DEG:g} degrees")


def _words(camera: CameraModel, sensor: str) -> str:
    if sensor:
        return (f"the camera is taken for that of a {sensor}, by the image's size: focal length "
                f"{camera.fx:g} pixels")
    return (f"the camera is taken for one that sees {_DEFAULT_FOV_DEG:g} degrees: focal length "
            f"{camera.fx:.0f} pixels")


def _depth_camera(pair: _Pair, size: _Size) -> CameraModel:
    focal, cx, cy = pair.depth[size]
    return CameraModel(width=size[0], height=size[1], fx=focal, fy=focal, cx=cx, cy=cy)


def _unknown_focal(size: _Size) -> float:
    return size[0] / 2 / math.tan(math.radians(_DEFAULT_FOV_DEG / 2))


def _centered(size: _Size, focal: float) -> CameraModel:
    width, height = size
    # SXGA is VGA, doubled, with 64 more rows below.
    rows = width * 3 // 4 if (width, height) == (1280, 1024) else height
    return CameraModel(width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2,
                       cy=(rows - 1) / 2)
