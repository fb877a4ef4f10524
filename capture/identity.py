"""Which sensor is which: by serial number, else by the USB port, else by OpenNI2's URI.

A URI ends in a USB device number, which each replug changes; a port does not, but it belongs to the
socket and not to the sensor. Many sensors have no serial number, or all the same one.
"""

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.calibration_files import read_calibration
from denseface.folders import user_folder

__all__ = [
    "Identity",
    "UsbDevice",
    "calibration_folder",
    "distinct",
    "file_name",
    "find_calibration",
    "identify",
    "known_as",
    "usb_devices",
]

USB_DEVICES = Path("/sys/bus/usb/devices")
"""Where Linux lists them."""
SENSORS = {
    (0x045E, 0x02AE): "Kinect v1", (0x045E, 0x02BF): "Kinect for Windows v1",
    (0x1D27, 0x0600): "Xtion", (0x1D27, 0x0601): "Xtion",
}
"""USB vendor and product of depth cameras that OpenNI2's drivers serve, by name."""
VENDORS = {0x2BC5: "Orbbec sensor", 0x1D27: "PrimeSense sensor", 0x2959: "Structure Sensor"}
"""USB vendors whose devices are all depth cameras or parts of one."""

_URI = re.compile(r"([0-9a-fA-F]{4})/([0-9a-fA-F]{4})@(\d+)/(\d+)")
"""A URI of PrimeSense's and Orbbec's drivers: vendor, product, bus and device number."""
_FREENECT = "freenect:"
"""How a URI of Freenect's driver starts."""
_MAX_TEXT = 128
"""Characters of a serial number; of more, or of others than printable ASCII, it is none."""
_CALIBRATIONS = "DENSEFACE_CALIBRATIONS"
"""Environment variable that names the folder of calibrations."""
_SUFFIX = ".calibration.json"


@dataclass(frozen=True)
class UsbDevice:
    """A device as Linux lists it."""

    port: str
    """Bus and the sockets from there on, as `1-4.2`: the same after a replug."""
    vendor: int
    product: int
    bus: int
    number: int
    """On the bus; another after a replug."""
    serial: str = ""
    """Empty where the device has none or every one of its kind has the same."""
    speed_mbit: float = 0.0
    """Of the connection; 0 where Linux does not say."""
    drivers: tuple[str, ...] = ()
    """Kernel drivers that hold one of its interfaces."""

    @property
    def kind(self) -> str | None:
        """Name the sensor; None for another device."""
        return SENSORS.get((self.vendor, self.product)) or VENDORS.get(self.vendor)

    @property
    def node(self) -> Path:
        """Give the file by which a program opens the device."""
        return Path(f"/dev/bus/usb/{self.bus:03d}/{self.number:03d}")

    def __str__(self) -> str:
        return f"{self.vendor:04x}:{self.product:04x} at port {self.port}"


@dataclass(frozen=True)
class Identity:
    """What a sensor can be asked for by; what is not known is empty."""

    uri: str
    """OpenNI2's; changes with a replug."""
    usb_port: str = ""
    serial: str = ""

    @property
    def name(self) -> str:
        """Give the most lasting of the three."""
        return self.serial or self.usb_port or self.uri

    def __str__(self) -> str:
        more = [f"serial {self.serial}" if self.serial else "",
                f"USB port {self.usb_port}" if self.usb_port else ""]
        found = ", ".join(filter(None, more))
        return f"{self.uri} ({found})" if found else self.uri


def usb_devices(root: Path = USB_DEVICES) -> list[UsbDevice]:
    """List the devices that are connected, by port; none where Linux lists none.

    root : what is read instead, for tests
    """
    try:
        names = sorted(entry.name for entry in root.iterdir())
    except OSError:
        return []
    found = []
    for name in names:
        if ":" in name or "-" not in name:  # an interface, or the root of a bus
            continue
        folder = root / name
        try:
            found.append(UsbDevice(
                name, int(_text(folder / "idVendor"), 16), int(_text(folder / "idProduct"), 16),
                int(_text(folder / "busnum")), int(_text(folder / "devnum")),
                plausible_serial(_text(folder / "serial")), _number(_text(folder / "speed")),
                tuple(sorted({_driver(root / each) for each in names
                              if each.startswith(f"{name}:")} - {""}))))
        except ValueError:
            continue  # it left while it was read
    return found


def identify(uri: str, serial: str | None, devices: Sequence[UsbDevice]) -> Identity:
    """Put together what is known of a sensor of OpenNI2.

    Parameters
    ----------
    uri : OpenNI2's
    serial : as the driver says; None where it does not
    devices : as `usb_devices` lists them
    """
    device = usb_device(uri, devices)
    said = plausible_serial(serial or "")
    if device is None:
        return Identity(uri, serial=said)
    return Identity(uri, device.port, said or device.serial)


def usb_device(uri: str, devices: Sequence[UsbDevice]) -> UsbDevice | None:
    """Find the USB device of a URI; None where the URI does not tell.

    One of Freenect's tells by a number that follows the order of a list of its own: only the
    single one is known.
    """
    if match := _URI.match(uri):
        vendor, product, bus, number = (int(part, base) for part, base in
                                        zip(match.groups(), (16, 16, 10, 10), strict=True))
        return next((d for d in devices if (d.vendor, d.product, d.bus, d.number)
                     == (vendor, product, bus, number)), None)
    kinects = [d for d in devices if "Kinect" in (d.kind or "")]
    return kinects[0] if uri.startswith(_FREENECT) and len(kinects) == 1 else None


def distinct(sensors: Iterable[Identity]) -> list[Identity]:
    """Drop serial numbers that two sensors have: of those, the port says which is which."""
    sensors = list(sensors)
    counts = Counter(sensor.serial for sensor in sensors)
    return [replace(sensor, serial="") if counts[sensor.serial] > 1 else sensor
            for sensor in sensors]


def known_as(wanted: str | Identity, sensors: Sequence[Identity]) -> Identity | None:
    """Find the sensor that is asked for: by serial, then by USB port, then by URI.

    Parameters
    ----------
    wanted : one of the three; or a sensor's identity, as of before it was unplugged: where that has
        a serial number, no other sensor at its port is taken for it
    sensors : those that are there, made `distinct`
    """
    if isinstance(wanted, Identity):
        if wanted.serial:
            # The driver may say the number only when the sensor is open.
            by_number = next((s for s in sensors if s.serial == wanted.serial), None)
            return by_number or next((s for s in sensors if not s.serial and wanted.usb_port
                                      and s.usb_port == wanted.usb_port), None)
        key = "usb_port" if wanted.usb_port else "uri"
        return next((s for s in sensors if getattr(s, key) == getattr(wanted, key)), None)
    return next((s for key in ("serial", "usb_port", "uri") for s in sensors
                 if wanted and getattr(s, key) == wanted), None)


def plausible_serial(text: str) -> str:
    """Give a serial number, stripped; empty where it is none, as `0000000000000000`."""
    text = text.strip().strip("\0")
    number = text.isascii() and text.isprintable() and len(text) <= _MAX_TEXT
    # Other texts are names of a kind, of which each sensor has the same.
    return text if number and len(set(text)) > 1 and any(map(str.isdigit, text)) else ""


def calibration_folder() -> Path:
    """Give the folder of the sensors' calibrations: `DENSEFACE_CALIBRATIONS`, else the user's."""
    if folder := os.environ.get(_CALIBRATIONS):
        return Path(folder)
    return user_folder("config") / "calibrations"


def file_name(name: str) -> str:
    """Give the name of the calibration file of a sensor's serial number, USB port or URI."""
    return re.sub(r"[^A-Za-z0-9._-]", "_", name).lstrip(".")[:_MAX_TEXT] + _SUFFIX


def find_calibration(sensor: Identity, folder: Path | None = None) -> ChosenCalibration | None:
    """Read the calibration file of a sensor, by serial, then USB port, then URI; None without one.

    Raises
    ------
    CalibrationError
        The file cannot be read.
    """
    folder = folder or calibration_folder()
    for what, name in (("serial", sensor.serial), ("USB port", sensor.usb_port),
                       ("URI", sensor.uri)):
        path = folder / file_name(name)
        if name and path.exists():
            return read_calibration(path)._replace(origin=f"by {what}: {path.name}")
    return None


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8", "replace").strip()
    except OSError:
        return ""


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def _driver(interface: Path) -> str:
    try:
        return (interface / "driver").readlink().name
    except OSError:
        return ""
