"""The sensors that OpenNI2 finds, each with its identity, and the one that is asked for."""

import ctypes
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from typing import Any

from denseface.capture.errors import SensorError
from denseface.capture.identity import (
    Identity,
    distinct,
    identify,
    known_as,
    usb_devices,
)
from denseface.capture.openni2._binding import OpenNIError, openni2
from denseface.capture.openni2._library import binding_errors, load, open_device

__all__ = ["available", "choose", "find", "identity_of", "why_absent"]

_SERIAL, _SERIAL_BYTES = 3, 256
"""OpenNI2's number of a device's property, and bytes that are read of it."""
_ASK_AGAIN_S = 5.0
"""Time for which a serial number, or that there was none, is remembered, seconds."""
_serials: dict[str, tuple[str | None, float]] = {}
"""Serial number by URI, and until when."""
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


def find(wanted: str | Identity | None) -> tuple[Identity | None, list[Identity]]:
    """Find a sensor: the first one for None, else by serial number, USB port or URI.

    Sensors are opened for their serial number only where nothing else leads to the one wanted.

    Parameters
    ----------
    wanted : one of the three, or the identity of a sensor before it was unplugged

    Returns
    -------
    the sensor, None where it is not there, and all that are

    Raises
    ------
    SensorError
        The library is missing, or refuses.
    """
    sensors = available()
    if wanted is None:
        return sensors[0] if sensors else None, sensors
    found = known_as(wanted, sensors)
    if found is None and (isinstance(wanted, str) or wanted.serial):
        devices = usb_devices()
        sensors = distinct(identify(s.uri, _serial_of(s.uri), devices) for s in sensors)
        found = known_as(wanted, sensors)
    return found, sensors


def choose(wanted: str | Identity | None, name: str) -> Identity:
    """Find a sensor, as `find`, for a source of that name.

    Raises
    ------
    SensorError
        It is not there; the message lists those that are.
    """
    found, sensors = find(wanted)
    if found is None:
        raise SensorError(why_absent(name, sensors))
    return found


def why_absent(name: str, sensors: Sequence[Identity]) -> str:
    """Say why a source finds no sensor, of those that are there."""
    if sensors:
        return f"{name}: no such sensor; found: {', '.join(map(str, sensors))}"
    seen = [f"{device.kind} {device}" for device in usb_devices() if device.kind]
    return f"{name}: OpenNI2 finds no sensor" + (
        f", Linux sees {', '.join(seen)}: run denseface doctor" if seen else "")


def identity_of(device: Any) -> Identity:
    """Identify an open device of the binding."""
    uri = bytes(device.device_info.uri).decode("utf-8", "replace")
    known = identify(uri, _serial(device), usb_devices())
    # Of a number that another sensor has as well, nothing follows.
    others = [sensor for sensor in available() if sensor.uri != uri]
    return distinct([known, *others])[0]


def _uris() -> list[str]:
    with binding_errors("OpenNI2 does not list its devices"):
        return [uri.decode("utf-8", "replace") for uri in openni2.Device.enumerate_uris()]


def _serial_of(uri: str) -> str | None:
    """Open a sensor for its serial number; None where it is in use or has none."""
    known, until_s = _serials.get(uri, (None, 0.0))
    if uri.startswith(_OPENED_ONCE) or time.monotonic() < until_s:
        return known
    with suppress(OpenNIError), closing(open_device(uri.encode())) as device:
        serial = _serial(device)
        _serials[uri] = serial, time.monotonic() + _ASK_AGAIN_S
        return serial
    return None


def _serial(device: Any) -> str | None:
    with suppress(OpenNIError):
        answer = device.get_property(_SERIAL, ctypes.c_char * _SERIAL_BYTES)
        return bytes(answer).partition(b"\0")[0].decode("ascii", "replace")
    return None
