"""A `Calibration` from what a sensor says of its own geometry, where that can be believed.

An Orbbec has a factory calibration (`_orbbec`). Of a PrimeSense sensor, the depth camera's focal
length is ZPD / ZPPS (zero plane distance by zero plane pixel size) in pixels of an image of 1280
columns; the colour camera is DCRCDIS beside it. Freenect's driver answers constants instead.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeGuard

from denseface.capture.calibration import (
    Calibration,
    CameraModel,
    ChosenCalibration,
    DepthToColor,
)
from denseface.capture.openni2._orbbec import believable

_ZPPS_COLUMNS = 1280
"""Columns of the image whose pixels ZPPS is given in."""
_KINECT_FOCAL, _XTION_FOCAL, _COLOR_FOCAL = 575.8, 570.3, 525.0
"""Default focal lengths: depth cameras of a Kinect v1 and an Xtion, any colour camera; pixels of
an image of `_BASE`."""
_BASE = 640, 480
"""Size of the mode that defaults are given for, pixels."""
_BASELINE_CM = 2.3
"""Default DCRCDIS."""
_PRIMESENSE_VENDOR = 0x1D27
"""USB vendor of the Xtion."""
_FREENECT_ZPPS, _FREENECT_ZPPS_TOLERANCE = 0.1052, 1e-6
"""What Freenect's driver answers for every Kinect, an Xtion's value, mm; as a float32."""

Size = tuple[int, int]
"""(width, height), pixels."""


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
    uri: str = ""
    """OpenNI2's of the device; empty of a recording."""
    orbbec: tuple[float, ...] | None = None
    """The factory calibration of an Orbbec, see `_orbbec`."""

    @property
    def by_freenect(self) -> bool:
        """These are constants of Freenect's driver, which serves the Kinect v1 alone.

        It is known by its URIs; in a recording, by a ZPPS of 0.1052 without a DCRCDIS: PrimeSense's
        driver records both.
        """
        if self.uri:
            return self.uri.startswith("freenect:")
        return (self.zpps_mm is not None and self.dcrcdis_cm is None
                and abs(self.zpps_mm - _FREENECT_ZPPS) < _FREENECT_ZPPS_TOLERANCE)


def derive_calibration(
    properties: SensorProperties, depth_size: Size, color_size: Size | None
) -> tuple[Calibration, str]:
    """Turn a sensor's properties into a calibration.

    Principal points are at the middle of the cameras' images of 640x480, the cameras' axes are
    parallel. The colour camera is to the right of the depth camera, seen from the sensor, so a
    point's x is *smaller* in its frame: the translation is minus DCRCDIS.

    Parameters
    ----------
    depth_size, color_size : of the modes in use; None for a sensor without a colour camera, whose
        calibration has the depth camera twice

    Returns
    -------
    the calibration, and in words what it was derived from
    """
    refused = ""
    if properties.orbbec is not None:
        factory, origin = believable(properties.orbbec, depth_size, color_size)
        if factory is not None:
            return factory, origin
        refused = f", {origin}"
    known = properties
    derivation: list[str] = []
    if known.by_freenect:
        known = replace(known, zpd_mm=None, zpps_mm=None, depth_fov=None, color_fov=None)
        derivation.append("Freenect's driver gives constants of another sensor")
    depth_focal, how = _depth_focal(known)
    derivation.append(how)
    depth = _centered(depth_size, depth_focal)
    if color_size is None:
        return (Calibration(depth=depth, color=depth), ", ".join(derivation) + refused)
    measured = _positive(known.dcrcdis_cm)
    baseline_cm = known.dcrcdis_cm if _positive(known.dcrcdis_cm) else _BASELINE_CM
    derivation.append(f"{'' if measured else 'default '}DCRCDIS {baseline_cm:.6g}")
    color_focal = _COLOR_FOCAL
    if _is_angle(known.color_fov):
        color_focal = _BASE[0] / 2 / math.tan(known.color_fov / 2)
        derivation.append(f"color field of view {math.degrees(known.color_fov):.1f} deg")
    calibration = Calibration(
        depth=depth, color=_centered(color_size, color_focal),
        depth_to_color=DepthToColor(translation_mm=(-10 * baseline_cm, 0, 0)))
    return calibration, ", ".join(derivation) + refused


def fit(chosen: ChosenCalibration, depth_size: Size, color_size: Size | None) -> ChosenCalibration:
    """Give a calibration of one's choice for other modes of the same sensor, where it is known how.

    depth_size, color_size : of the modes in use; None for a sensor without a colour camera
    """
    calibration = chosen.calibration
    changed = {}
    for name, camera, size in (("depth", calibration.depth, depth_size),
                               ("color", calibration.color, color_size)):
        if size is not None and size != (camera.width, camera.height):
            with suppress(ValueError):  # the frame says that the sizes differ
                changed[name] = camera.cut_to(*size)
    if not changed:
        return chosen
    cut = ", ".join(f"{name} cut to {camera.width}x{camera.height}"
                    for name, camera in changed.items())
    return chosen._replace(calibration=calibration.model_copy(update=changed),
                           origin=f"{chosen.origin}, {cut}")


def _depth_focal(p: SensorProperties) -> tuple[float, str]:
    """Give the focal length in pixels of an image of `_BASE`, and in words where it is from."""
    if _positive(p.zpd_mm) and _positive(p.zpps_mm):
        return (p.zpd_mm / p.zpps_mm * _BASE[0] / _ZPPS_COLUMNS,
                f"ZPD {p.zpd_mm}, ZPPS {p.zpps_mm:.6g}")
    if _is_angle(p.depth_fov):
        return (_BASE[0] / 2 / math.tan(p.depth_fov / 2),
                f"depth field of view {math.degrees(p.depth_fov):.1f} deg")
    sensor, focal = (("Xtion", _XTION_FOCAL) if p.usb_vendor == _PRIMESENSE_VENDOR
                     else ("Kinect v1", _KINECT_FOCAL))
    return focal, f"default depth f {focal:.1f} ({sensor})"


def _centered(size: Size, focal: float) -> CameraModel:
    """Give the camera whose principal point is at the middle of its image of `_BASE`.

    focal : pixels of `_BASE`
    """
    width, height = _BASE
    base = CameraModel(width=width, height=height, fx=focal, fy=focal,
                       cx=(width - 1) / 2, cy=(height - 1) / 2)
    try:
        return base.cut_to(*size)
    except ValueError:  # no known cut of the sensor: about its middle
        focal *= size[0] / width
        return CameraModel(width=size[0], height=size[1], fx=focal, fy=focal,
                           cx=(size[0] - 1) / 2, cy=(size[1] - 1) / 2)


def _positive(value: float | None) -> TypeGuard[float]:
    return value is not None and math.isfinite(value) and value > 0


def _is_angle(value: float | None) -> TypeGuard[float]:
    return value is not None and 0.1 < value < math.pi - 0.1
