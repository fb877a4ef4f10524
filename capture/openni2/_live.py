"""Live sensors: always the newest pair, and an error when the sensor falls silent or leaves."""

import time
from collections.abc import Iterator

from primesense import openni2

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import SensorError, SensorTimeoutError
from denseface.capture.frame import RgbdFrame
from denseface.capture.openni2._base import OpenNI2Source
from denseface.capture.openni2._library import binding_errors, load, lost_devices
from denseface.capture.openni2._streams import COLOR, DEPTH, Streams

_SLICE_S = 0.1
"""Longest single wait, seconds: Ctrl-C and an unplugged sensor are noticed in between."""
_STALE_S = 0.1
"""Seconds since the last read after which waiting frames are thrown away."""


class LiveSource(OpenNI2Source):
    """A sensor; each step of an iteration gives the newest pair.

    Parameters
    ----------
    device_uri : OpenNI2's URI of the device; None for the first one
    timeout_s : how long to wait for a pair
    start : start the streams at once; a recorder has to be attached before

    Raises
    ------
    SensorError
        No such device, no depth or colour stream, or the library is missing; while iterating, the
        device went away.
    SensorTimeoutError
        No pair came in time.
    """

    _live = True

    def __init__(
        self, device_uri: str | None = None, chosen: ChosenCalibration | None = None, *,
        timeout_s: float = 5.0, start: bool = True,
    ) -> None:
        super().__init__(f"openni2:{device_uri or ''}", chosen)
        self.timeout_s = timeout_s
        self._last_read = float("-inf")
        load()
        found = openni2.Device.enumerate_uris()
        if not found:
            raise SensorError(f"{self._name}: OpenNI2 finds no sensor")
        wanted = found[0] if device_uri is None else device_uri.encode()
        # OpenNI2 would also open the name of a file.
        if wanted not in found:
            known = ", ".join(uri.decode("utf-8", "replace") for uri in found)
            raise SensorError(f"{self._name}: no such sensor; found: {known}")
        with binding_errors(f"{self._name}: cannot be opened"):
            device = openni2.Device(wanted)
        self._device_uri = bytes(device.uri)
        lost_devices.discard(self._device_uri)
        self._open_streams(device)
        if start:
            self.start()

    def start(self) -> None:
        """Start both streams of a source that was made with `start=False`."""
        self.streams.start()
        self._last_read = time.monotonic()

    def __iter__(self) -> Iterator[RgbdFrame]:
        while self._streams is not None:
            yield self.read()

    def read(self) -> RgbdFrame:
        """Wait for a pair and give it.

        OpenNI2 keeps the newest frame of each stream, however old. After a pause in reading, those
        are thrown away first: no frame is from before the call.
        """
        streams = self.streams
        if time.monotonic() - self._last_read > _STALE_S:
            self.flush()
        deadline = time.monotonic() + self.timeout_s
        received = {DEPTH: 0, COLOR: 0}
        while True:
            kind = streams.wait(min(_SLICE_S, max(deadline - time.monotonic(), 0.0)))
            self._check_present()
            if kind is not None:
                received[kind] += 1
                if pair := self._add(kind, streams.read(kind)):
                    self._last_read = time.monotonic()
                    return self._frame(pair)
            if time.monotonic() >= deadline:
                raise SensorTimeoutError(
                    f"{self._name}: no depth and color pair within {self.timeout_s:g} s (received "
                    f"{received[DEPTH]} depth and {received[COLOR]} color frames)")

    def flush(self) -> None:
        """Throw away waiting frames: the next one is from after this call."""
        streams = self.streams
        for kind in (DEPTH, COLOR):
            if streams.wait(0.0, (kind,)) is not None:
                streams.read(kind)
        self.pairer.clear()

    @property
    def streams(self) -> Streams:
        """The open streams.

        Raises
        ------
        SensorError
            The source was closed, or the device went away.
        """
        self._check_present()
        if self._streams is None:
            raise SensorError(f"{self._name}: is closed")
        return self._streams

    def _check_present(self) -> None:
        if self._device_uri in lost_devices:
            raise SensorError(
                f"{self._name}: the sensor {self._device_uri.decode()} was unplugged or failed")
