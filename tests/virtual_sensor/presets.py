"""Sensors that exist, as fields of a `Control`: `Control(path, clip, **XTION)`.

A device's fields; those of its streams are set by `as_structure_sensor` and the like.
"""

from typing import Any

from tests.virtual_sensor.control import Control, Driver, Format, Honesty, Mode

__all__ = ["ASTRA", "KINECT", "STRUCTURE", "XTION", "as_astra", "as_kinect", "as_structure_sensor",
           "as_xtion"]

XTION: dict[str, Any] = {
    "vendor": "PrimeSense", "name": "PS1080", "uri": "1d27/0601@1/7", "usb_vendor": 0x1D27,
    "usb_product": 0x0601, "serial": "1206120123", "registration": Honesty.HONEST}
"""An Asus Xtion Pro Live on the PS1080 driver; the URI ends in USB bus and device number."""
STRUCTURE: dict[str, Any] = XTION | {
    "uri": "1d27/0600@1/9", "usb_product": 0x0600, "serial": "24817", "registration":
    Honesty.MISSING}
"""A Structure Sensor on the same driver: no colour camera."""
KINECT: dict[str, Any] = {
    "vendor": "Microsoft", "name": "Kinect", "uri": "freenect://0", "usb_vendor": 0x045E,
    "usb_product": 0x02AE, "driver": Driver.FREENECT, "hotplug": False,
    "registration": Honesty.HONEST, "camera_controls": False}
"""A Kinect v1 on libfreenect's driver."""
ASTRA: dict[str, Any] = {
    "vendor": "Orbbec", "name": "Astra", "uri": "2bc5/0401@1/11", "usb_vendor": 0x2BC5,
    "usb_product": 0x0401, "serial": "17122730085", "driver": Driver.ORBBEC,
    "registration": Honesty.HONEST}
"""An Orbbec Astra on Orbbec's driver."""

_DEPTH, _FINE = Format.DEPTH_1_MM, Format.DEPTH_100_UM


def as_xtion(control: Control) -> None:
    """Make it an Xtion, with all its modes; QVGA is the one it starts with."""
    control.update(XTION)
    control.depth.offer(*(Mode(*size, format=unit) for unit in (_DEPTH, _FINE)
                          for size in ((320, 240, 30), (320, 240, 60), (640, 480, 30))))
    control.color.offer(*(Mode(*size, format=pixels) for pixels in (Format.YUV422, Format.RGB888)
                          for size in ((320, 240, 30), (320, 240, 60), (640, 480, 30),
                                       (1280, 1024, 30))))


def as_structure_sensor(control: Control) -> None:
    """Make it a Structure Sensor: depth alone."""
    as_xtion(control)
    control.update(STRUCTURE)
    control.color.present = False


def as_kinect(control: Control) -> None:
    """Make it a Kinect on Freenect: one mode, not mirrored at the start, cropping in name only."""
    control.update(KINECT)
    for stream in (control.depth, control.color):
        stream.mirrored_at_start = False
        stream.cropping = Honesty.IDLE


def as_astra(control: Control) -> None:
    """Make it an Astra: mirrored at the start, with 640x400 beside 640x480."""
    control.update(ASTRA)
    control.depth.offer(*(Mode(*size, format=_DEPTH) for size in (
        (640, 480, 30), (640, 400, 30), (320, 240, 30))))
    control.color.offer(*(Mode(*size, format=Format.RGB888) for size in (
        (640, 480, 30), (320, 240, 30))))
