"""The capture process: the only one that touches a sensor or OpenNI2.

All of the driver is called in one thread, so that this process answers while the driver does not;
one that hangs ends the process, and the supervisor starts another.
"""

import os
import socket
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import structlog

from capture import CaptureError, RgbdFrame, Source, open_source
from capture.errors import SensorError, UnreadableSourceError
from service.background import Background
from service.failpoints import failpoint
from service.link import HubLink
from service.messages import (
    Announce,
    Frame,
    FrameAccepted,
    FrameFailed,
    FrameRefused,
    SensorReady,
    Take,
)
from service.payload import FrameHeader
from service.settings import ServiceSettings
from service.stopping import StopSignal
from service.wire import Packet

__all__ = ["run"]

_CLOSING_S = 3.0
"""Longest wait at the end for a frame under way, seconds."""


def run(settings: ServiceSettings, uri: str, calibration: Path | None = None) -> int:
    """Serve frames of a source until SIGINT or SIGTERM and give the exit status.

    A live sensor gives its newest frame for each press; a recording gives its frames in order,
    one for each press, and starts over after the last.

    Raises
    ------
    CaptureError
        Where the source cannot be opened, or a live sensor went away.
    """
    sensor = _Sensor(uri, calibration)
    with StopSignal() as stop, Background[RgbdFrame | None]("sensor") as driver:
        try:
            with HubLink(settings, "capture") as link:
                _Capture(settings, link, sensor, driver).serve(stop)
        finally:
            _close(driver, sensor)
        return stop.exit_status


def _close(driver: Background[RgbdFrame | None], sensor: "_Sensor") -> None:
    if not driver.ends_within(_CLOSING_S):
        structlog.get_logger("capture").error("the driver hangs", source=sensor.uri)
        os._exit(1)
    with suppress(CaptureError):
        if driver:
            driver.take()
    driver.start(sensor.close)
    driver.take()


class _Sensor:
    """A source without an end. All methods are called in the driver's thread."""

    def __init__(self, uri: str, calibration: Path | None) -> None:
        self.uri = uri
        self._calibration = calibration
        self._source: Source | None = None
        self._frames: Iterator[RgbdFrame] = iter(())

    def open(self) -> None:
        self._source = open_source(self.uri, calibration=self._calibration)

    def take(self) -> RgbdFrame:
        if self._source is None:
            raise SensorError(f"{self.uri}: is not open")
        for _ in range(2):
            frame = next(self._frames, None)
            if frame is not None:
                return frame
            self._frames = iter(self._source)
        raise UnreadableSourceError(f"{self.uri}: holds no pair of a depth and a colour frame")

    def close(self) -> None:
        if self._source is not None:
            self._source.close()


class _Capture:
    def __init__(
        self, settings: ServiceSettings, link: HubLink, sensor: _Sensor,
        driver: Background[RgbdFrame | None],
    ) -> None:
        self._settings = settings
        self._link = link
        self._sensor = sensor
        self._driver = driver
        self._log = structlog.get_logger("capture")
        self._open = False
        self._asked: deque[str] = deque()
        self._unsafe: dict[str, tuple[RgbdFrame, float]] = {}
        """Frames that the hub has not yet said are safe, and when each is to be sent again."""

    def serve(self, stop: StopSignal) -> None:
        self._driver.start(self._sensor.open)
        for packet in self._link.packets(stop, self._driver, lambda: None):
            if packet is not None:
                self._receive(packet)
            if self._driver.ended():
                self._called()
            elif self._driver.elapsed_s > self._settings.take_timeout_s:
                self._log.error("the driver hangs", source=self._sensor.uri,
                                seconds=self._driver.elapsed_s)
                os._exit(1)
            if self._asked and not self._driver:
                self._driver.start(self._sensor.take)
            self._send_again()

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if self._open:
                    self._ready()
            case Take(capture_id=capture_id):
                failpoint("capture.take.received")
                if capture_id in self._unsafe:
                    self._send(capture_id, self._unsafe[capture_id][0])
                elif capture_id not in self._asked:
                    self._asked.append(capture_id)
            case FrameAccepted(capture_id=capture_id):
                self._unsafe.pop(capture_id, None)
            case FrameRefused(capture_id=capture_id, message=reason):
                self._log.warning("frame refused", capture_id=capture_id, reason=reason)
                self._unsafe.pop(capture_id, None)

    def _ready(self) -> None:
        self._link.send(SensorReady(
            name=f"{socket.gethostname()}/{os.getpid()}", source=self._sensor.uri))

    def _called(self) -> None:
        if not self._open:
            self._driver.take()
            self._open = True
            self._log.info("source open", source=self._sensor.uri)
            self._ready()
            return
        capture_id = self._asked.popleft()
        try:
            frame = self._driver.take()
        except CaptureError as error:
            self._log.error("no frame", capture_id=capture_id, reason=str(error))
            self._link.send(FrameFailed(capture_id=capture_id, message=str(error)[:4000]))
            if isinstance(error, SensorError):
                raise
        else:
            failpoint("capture.frame.taken")
            if frame is not None:
                self._log.info("taken", capture_id=capture_id, skew_us=frame.skew_us)
                self._send(capture_id, frame)

    def _send(self, capture_id: str, frame: RgbdFrame) -> None:
        header, arrays = FrameHeader.of(frame)
        self._unsafe[capture_id] = frame, time.monotonic() + self._settings.resend_s
        self._link.send(Frame(capture_id=capture_id, frame=header), arrays)
        failpoint("capture.frame.sent")

    def _send_again(self) -> None:
        """Repeat what got no answer: the hub accepts it, or says that nobody waits any more."""
        now = time.monotonic()
        for capture_id, (frame, due) in list(self._unsafe.items()):
            if now >= due:
                self._log.warning("frame not acknowledged, sent again", capture_id=capture_id)
                self._send(capture_id, frame)
