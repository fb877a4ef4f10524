"""The sensors that OpenNI2 finds, each with its identity, and the one that is asked for."""

import ctypes
from contextlib import closing, suppress
from typing import Any

from primesense import openni2
from primesense.utils import OpenNIError

from denseface.capture.errors import SensorError
from denseface.capture.identity import (
    Identity,
    UsbDevice,
    distinct,
    identify,
    known_as,
    usb_devices,
)
from denseface.capture.openni2._library import binding_errors, load, open_device

__all__ = ["available", "choose", "identity_of"]

_SERIAL, _SERIAL_BYTES = 3, 256
"""OpenNI2's number of a device's property, and bytes that are read of it."""
_OPENED_ONCE = "freenect:"
"""Start of the URIs of a driver that forgets a device when it is closed, and knows no serial."""


def available() -> list[Identity]:
    """List the sensors, none of which is opened: serial numbers are those that Linux reads.

    Raises
    ------
    SensorError
        The library is missing, or refuses.
    """
    load()
    devices = usb_devices()
    return distinct(identify(uri, None, devices) for uri in _uris())


def choose(wanted: str | Identity | None, name: str) -> Identity:
    """Find a sensor: the first one for None, else by serial number, USB port or URI.

    Sensors are opened for their serial number only where nothing else leads to the one wanted.

    Parameters
    ----------
    wanted : one of the three, or the identity of a sensor before it was unplugged
    name : of the source, for messages

    Raises
    ------
    SensorError
        It is not there; the message lists those that are.
    """
    sensors = available()
    if not sensors:
        raise SensorError(f"{name}: OpenNI2 finds no sensor{_unseen(usb_devices())}")
    if wanted is None:
        return sensors[0]
    found = known_as(wanted, sensors)
    if found is None and _by_serial(wanted):
        devices = usb_devices()
        sensors = distinct(identify(s.uri, _serial_of(s.uri), devices) for s in sensors)
        found = known_as(wanted, sensors)
    if found is None:
        raise SensorError(f"{name}: no such sensor; found: {', '.join(map(str, sensors))}")
    return found


def identity_of(device: Any) -> Identity:
    """Identify an open device of the binding."""
    uri = bytes(device.device_info.uri).decode("utf-8", "replace")
    known = identify(uri, _serial(device), usb_devices())
    # Of a number that another sensor has as well, nothing follows.
    others = [sensor for sensor in available() if sensor.uri != uri]
    return distinct([known, *others])[0]


def _by_serial(wanted: str | Identity) -> bool:
    return isinstance(wanted, str) or bool(wanted.serial)


def _uris() -> list[str]:
    with binding_errors("OpenNI2 does not list its devices"):
        return [uri.decode("utf-8", "replace") for uri in openni2.Device.enumerate_uris()]


def _serial_of(uri: str) -> str | None:
    """Open a sensor for its serial number; None where it is in use or has none."""
    if uri.startswith(_OPENED_ONCE):
        return None
    with suppress(OpenNIError), closing(open_device(uri.encode())) as device:
        return _serial(device)
    return None


def _serial(device: Any) -> str | None:
    with suppress(OpenNIError):
        answer = device.get_property(_SERIAL, ctypes.c_char * _SERIAL_BYTES)
        return bytes(answer).partition(b"\0")[0].decode("ascii", "replace")
    return None


def _unseen(devices: list[UsbDevice]) -> str:
    """Name the sensors that Linux sees, where OpenNI2 sees none."""
    seen = [f"{d.kind} {d}" for d in devices if d.kind]
    return f", Linux sees {', '.join(seen)}: run denseface doctor" if seen else ""
