"""Sensors that Linux lists and the driver does not: one that was plugged in unnoticed.

Drivers hear of a new device from the system, which in a container may not be told, or list devices
only when they are loaded. Then another process is needed.
"""

from collections.abc import Iterable, Sequence

from denseface.capture.identity import UsbDevice, usb_device

__all__ = ["UsbWatch"]

_UNLISTED_S = 1.0
"""Time within which a driver that hears of new devices lists one, seconds."""

_STALE = "freenect:"
"""How URIs begin of the driver that goes on listing what was unplugged."""


class UsbWatch:
    """Compares what Linux lists with what the driver does.

    Parameters
    ----------
    first : devices that were there when the driver was loaded: of those it knows all it ever will
    """

    def __init__(self, first: Iterable[UsbDevice]) -> None:
        self._known: set[tuple[str, int]] = set()
        self.know(first)
        self._since: dict[tuple[str, int], float] = {}
        """When new ones were seen first, monotonic clock, seconds."""

    def know(self, devices: Iterable[UsbDevice]) -> None:
        """Take devices for known, as those that are there when a sensor was opened."""
        self._known |= {_key(device) for device in devices}

    def unlisted(self, devices: Sequence[UsbDevice], uris: Iterable[str], now_s: float) -> str:
        """Name a sensor that came since, and that the driver has not listed in time; else empty.

        Parameters
        ----------
        devices : as Linux lists them
        uris : of the sensors that the driver lists
        """
        self.know(found for uri in uris if not uri.startswith(_STALE)
                  if (found := usb_device(uri, devices)))
        came = {_key(one): one for one in devices if one.kind and _key(one) not in self._known}
        self._since = {key: self._since.get(key, now_s) for key in came}
        late = (came[key] for key, since_s in self._since.items() if now_s - since_s > _UNLISTED_S)
        return next((f"{one.kind} {one}" for one in late), "")


def _key(device: UsbDevice) -> tuple[str, int]:
    """Tell one plugging in from another: each gives the device a new number."""
    return device.port, device.number
