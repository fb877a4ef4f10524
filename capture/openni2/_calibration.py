"""What a PrimeSense sensor knows of its own geometry, as a `Calibration`.

Focal length of the depth camera = ZPD / ZPPS (zero plane distance by zero plane pixel size) in
pixels of 1280 columns; the colour camera stands DCRCDIS beside it.
"""

import math
from dataclasses import dataclass
from typing import TypeGuard

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

__all__ = ["SensorProperties", "calibration_of"]

_REFERENCE_COLUMNS = 1280
_KINECT_FOCAL = 575.8
_XTION_FOCAL = 570.3
_COLOR_FOCAL = 525.0
_FOCAL_COLUMNS = 640
_BASELINE_CM = 2.3
_PRIMESENSE_VENDOR = 0x1D27


@dataclass(frozen=True)
class SensorProperties:
    """What the driver or the recording answered; None where it did not."""

    zpd_mm: int | None = None
    zpps_mm: float | None = None
    dcrcdis_cm: float | None = None
    depth_fov: float | None = None
    """Horizontal field of view of the depth camera, radians."""
    color_fov: float | None = None
    """Horizontal field of view of the colour camera, radians."""
    usb_vendor: int = 0


def calibration_of(
    properties: SensorProperties, depth_size: tuple[int, int], color_size: tuple[int, int]
) -> tuple[Calibration, str]:
    """Turn a sensor's properties into a calibration.

    Principal points lie in the middle and the cameras look the same way. Seen from the sensor,
    the projector and the colour camera stand to the right of the depth camera, so a point's x is
    *smaller* for the colour camera: the translation is minus DCRCDIS.

    Parameters
    ----------
    depth_size, color_size : (width, height), pixels

    Returns
    -------
    the calibration, and in words where it comes from
    """
    said = []
    p = properties
    width = depth_size[0]
    if _positive(p.zpd_mm) and _positive(p.zpps_mm):
        depth_focal = p.zpd_mm / p.zpps_mm * width / _REFERENCE_COLUMNS
        said += [f"ZPD {p.zpd_mm}", f"ZPPS {p.zpps_mm:.6g}"]
    elif _is_angle(p.depth_fov):
        depth_focal = width / 2 / math.tan(p.depth_fov / 2)
        said.append(f"depth field of view {math.degrees(p.depth_fov):.1f} deg")
    else:
        xtion = p.usb_vendor == _PRIMESENSE_VENDOR
        depth_focal = (_XTION_FOCAL if xtion else _KINECT_FOCAL) * width / _FOCAL_COLUMNS
        said.append(f"default depth f {depth_focal:.1f} ({'Xtion' if xtion else 'Kinect v1'})")
    baseline_cm = _BASELINE_CM
    if _positive(p.dcrcdis_cm):
        baseline_cm = p.dcrcdis_cm
        said.append(f"DCRCDIS {baseline_cm:.6g}")
    else:
        said.append(f"default DCRCDIS {baseline_cm}")
    if _is_angle(p.color_fov):
        color_focal = color_size[0] / 2 / math.tan(p.color_fov / 2)
        said.append(f"color field of view {math.degrees(p.color_fov):.1f} deg")
    else:
        color_focal = _COLOR_FOCAL * color_size[0] / _FOCAL_COLUMNS
    calibration = Calibration(
        depth=_centred(depth_size, depth_focal),
        color=_centred(color_size, color_focal),
        depth_to_color=DepthToColor(translation_mm=(-10 * baseline_cm, 0, 0)),
    )
    return calibration, ", ".join(said)


def _centred(size: tuple[int, int], focal: float) -> CameraModel:
    width, height = size
    return CameraModel(width=width, height=height, fx=focal, fy=focal,
                       cx=(width - 1) / 2, cy=(height - 1) / 2)


def _positive(value: float | None) -> TypeGuard[float]:
    return value is not None and math.isfinite(value) and value > 0


def _is_angle(value: float | None) -> TypeGuard[float]:
    return value is not None and 0.1 < value < math.pi - 0.1
