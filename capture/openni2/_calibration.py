"""A `Calibration` from what a PrimeSense sensor says of its own geometry.

The depth camera's focal length is ZPD / ZPPS (zero plane distance by zero plane pixel size) in
pixels of an image of 1280 columns; the colour camera is DCRCDIS beside it.
"""

import math
from dataclasses import dataclass
from typing import TypeGuard

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

_ZPPS_COLUMNS = 1280
"""Columns of the image whose pixels ZPPS is given in."""
_KINECT_FOCAL, _XTION_FOCAL, _COLOR_FOCAL = 575.8, 570.3, 525.0
"""Default focal lengths: depth cameras of a Kinect v1 and an Xtion, any colour camera; pixels of
an image of `_FOCAL_COLUMNS`."""
_FOCAL_COLUMNS = 640
_BASELINE_CM = 2.3
"""Default DCRCDIS."""
_PRIMESENSE_VENDOR = 0x1D27
"""USB vendor of the Xtion."""


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


def derive_calibration(
    properties: SensorProperties, depth_size: tuple[int, int], color_size: tuple[int, int]
) -> tuple[Calibration, str]:
    """Turn a sensor's properties into a calibration.

    Principal points are at the images' centres and the cameras' axes are parallel. The colour
    camera is to the right of the depth camera, seen from the sensor, so a point's x is *smaller*
    in its frame: the translation is minus DCRCDIS.

    Parameters
    ----------
    depth_size, color_size : (width, height), pixels

    Returns
    -------
    the calibration, and in words what it was derived from
    """
    derivation, p, width = [], properties, depth_size[0]
    if _positive(p.zpd_mm) and _positive(p.zpps_mm):
        depth_focal = p.zpd_mm / p.zpps_mm * width / _ZPPS_COLUMNS
        derivation += [f"ZPD {p.zpd_mm}", f"ZPPS {p.zpps_mm:.6g}"]
    elif _is_angle(p.depth_fov):
        depth_focal = width / 2 / math.tan(p.depth_fov / 2)
        derivation.append(f"depth field of view {math.degrees(p.depth_fov):.1f} deg")
    else:
        sensor, focal = (("Xtion", _XTION_FOCAL) if p.usb_vendor == _PRIMESENSE_VENDOR
                         else ("Kinect v1", _KINECT_FOCAL))
        depth_focal = focal * width / _FOCAL_COLUMNS
        derivation.append(f"default depth f {depth_focal:.1f} ({sensor})")
    known = _positive(p.dcrcdis_cm)
    baseline_cm = p.dcrcdis_cm if _positive(p.dcrcdis_cm) else _BASELINE_CM
    derivation.append(f"{'' if known else 'default '}DCRCDIS {baseline_cm:.6g}")
    if _is_angle(p.color_fov):
        color_focal = color_size[0] / 2 / math.tan(p.color_fov / 2)
        derivation.append(f"color field of view {math.degrees(p.color_fov):.1f} deg")
    else:
        color_focal = _COLOR_FOCAL * color_size[0] / _FOCAL_COLUMNS
    calibration = Calibration(
        depth=_centred(depth_size, depth_focal),
        color=_centred(color_size, color_focal),
        depth_to_color=DepthToColor(translation_mm=(-10 * baseline_cm, 0, 0)),
    )
    return calibration, ", ".join(derivation)


def _centred(size: tuple[int, int], focal: float) -> CameraModel:
    width, height = size
    return CameraModel(width=width, height=height, fx=focal, fy=focal,
                       cx=(width - 1) / 2, cy=(height - 1) / 2)


def _positive(value: float | None) -> TypeGuard[float]:
    return value is not None and math.isfinite(value) and value > 0


def _is_angle(value: float | None) -> TypeGuard[float]:
    return value is not None and 0.1 < value < math.pi - 0.1
