"""The doctor's look at this machine: Python, the library, its drivers, USB. Opens nothing."""

import os
import platform
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from denseface.capture import CaptureError
from denseface.capture.identity import UsbDevice
from denseface.capture.openni2 import library_folder
from denseface.service.runtime.process import untried_python
from denseface.service.tools.doctor.findings import Finding, ok, problem, warning

__all__ = ["look_at_library", "look_at_python", "look_at_usb"]

_HIGH_SPEED_MBIT = 480
"""USB 2: 640x480 depth and colour at 30 frames a second are some 250 Mbit/s."""
_KERNEL_DRIVER = "gspca_kinect"
"""Takes a Kinect's camera for a webcam."""
_UDEV = Path("/run/udev/control")
"""There while udev runs, of which PrimeSense's driver learns that a sensor comes or goes."""
_DRIVERS = {0x045E: "Freenect", 0x1D27: "PS1080", 0x2BC5: "orbbec", 0x2959: "PS1080"}
"""Part of the file name of the driver that serves a USB vendor's sensors."""
_FREENECT = ("build libfreenect with -DBUILD_OPENNI2_DRIVER=ON and copy libFreenectDriver.so to "
             "{folder}/libFreenectDriver.so.0 (docs/operating.md, Kinect v1)")
_ORBBEC = "copy liborbbec.so of Orbbec's OpenNI2 SDK to {folder}"


def look_at_python() -> Finding:
    """Name the Python, and say where it is one that was not tried."""
    if doubt := untried_python():
        return warning("Python", doubt, "install denseface with one of those")
    return ok("Python", f"{platform.python_version()}, {sys.executable}")


def look_at_library(devices: Sequence[UsbDevice]) -> Iterator[Finding]:
    """Look for OpenNI2 and for the drivers of the devices that are there."""
    try:
        library = library_folder()
    except CaptureError as error:
        yield problem("OpenNI2", str(error), "apt install libopenni2-dev")
        return
    folder = library / "OpenNI2" / "Drivers"
    drivers = sorted({path.name.partition(".")[0].removeprefix("lib")
                      for path in folder.glob("lib*.so*")})
    if not drivers:
        yield problem("drivers", f"none in {folder}", "apt install libopenni2-0")
        return
    names = " ".join(drivers).lower()
    more = "" if "freenect" in names else (
        "; no Freenect, which a Kinect v1 needs and Debian does not ship (docs/operating.md)")
    yield ok("drivers", f"{', '.join(drivers)} in {folder}{more}")
    for vendor, driver in _DRIVERS.items():
        if driver.lower() not in names and any(
                device.vendor == vendor and device.kind for device in devices):
            remedy = {"Freenect": _FREENECT, "orbbec": _ORBBEC}.get(
                driver, "apt install libopenni2-0").format(folder=folder)
            yield problem("drivers", f"no {driver} driver for the {_names(devices, vendor)}",
                          remedy)


def look_at_usb(devices: Sequence[UsbDevice], root: Path = Path("/")) -> Iterator[Finding]:
    """Look at the sensors that Linux sees, how they are connected, and who may open them.

    root : what `/` is, for tests
    """
    sensors = [device for device in devices if device.kind]
    if not sensors:
        yield warning("USB", "Linux sees no depth sensor", "plug it in, with its power supply; "
                      "lsusb shows what is there; in a container, --device /dev/bus/usb")
        return
    if not _under(root, _UDEV).exists():
        yield warning("udev", "does not run here: PrimeSense's driver does not notice when a "
                      "sensor is plugged in again", "run denseface outside a container, or give "
                      "it /run/udev")
    per_bus = Counter(sensor.bus for sensor in sensors)
    for sensor in sensors:
        yield from _look_at_sensor(sensor, per_bus[sensor.bus], root)


def _look_at_sensor(sensor: UsbDevice, on_bus: int, root: Path) -> Iterator[Finding]:
    what = f"USB {sensor.port}"
    speed = f"{sensor.speed_mbit:g} Mbit/s" if sensor.speed_mbit else "unknown speed"
    found = f"{sensor.kind}, {sensor.vendor:04x}:{sensor.product:04x}, {speed}"
    if 0 < sensor.speed_mbit < _HIGH_SPEED_MBIT:
        yield problem(what, f"{found}: too slow for depth and color",
                      "another port, cable or hub: it needs USB 2 with 480 Mbit/s")
    elif on_bus > 1 and sensor.speed_mbit <= _HIGH_SPEED_MBIT:
        yield warning(what, f"{found}, and {on_bus - 1} more sensor on its bus",
                      "two sensors want two USB controllers: try a port elsewhere (lsusb -t)")
    else:
        yield ok(what, found)
    if _KERNEL_DRIVER in sensor.drivers:
        yield problem(what, f"the kernel's {_KERNEL_DRIVER} holds its camera",
                      f"as root: modprobe -r {_KERNEL_DRIVER}; for good: echo blacklist "
                      f"{_KERNEL_DRIVER} > /etc/modprobe.d/{_KERNEL_DRIVER}.conf")
    node = _under(root, sensor.node)
    if not node.exists():
        yield problem(what, f"{sensor.node} is not there",
                      "in a container, --device /dev/bus/usb; else plug it in again")
    elif not os.access(node, os.R_OK | os.W_OK):
        yield problem(
            what, f"{sensor.node} may not be opened by this user",
            f'as root: echo \'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{sensor.vendor:04x}", '
            "MODE=\"0666\"' > /etc/udev/rules.d/60-depth-sensor.rules; udevadm control --reload; "
            "plug it in again")


def _under(root: Path, path: Path) -> Path:
    return root / path.relative_to("/")


def _names(devices: Sequence[UsbDevice], vendor: int) -> str:
    return ", ".join(f"{device.kind} at USB {device.port}" for device in devices
                     if device.vendor == vendor and device.kind)
