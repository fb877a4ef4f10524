"""The capture process: the only one that touches a sensor or OpenNI2.

The driver is called in a thread of its own, so that this process answers the hub while it waits.
A driver that hangs ends the process; the supervisor starts another.
"""

import re
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import structlog

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.errors import SensorError
from denseface.service.daemons.preview_picture import preview_jpeg
from denseface.service.daemons.sensor import SensorReader
from denseface.service.errors import FrameTooLargeError
from denseface.service.log.output import exit_now
from denseface.service.protocol import messages
from denseface.service.protocol.payload import (
    FrameHeader,
    PreviewHeader,
    check_frame_size,
)
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.supervisor_link import SupervisorLink
from denseface.service.settings import ServiceSettings
from denseface.service.transport.hub_connection import HubConnection

__all__ = ["run", "sensor_name"]

_CLOSING_S = 3.0
"""Longest wait for the driver's last call when the process stops, seconds."""
_MAX_RESEND_S = 30.0
"""Longest pause before a frame that is not acknowledged is sent again, seconds."""
_log = structlog.get_logger("capture")


def run(settings: ServiceSettings, uri: str, calibration: Path | None = None,
        supervisor: SupervisorLink | None = None, name: str | None = None) -> int:
    """Serve frames of a source until SIGINT or SIGTERM and give the exit status.

    A press gets the newest frame of a live sensor; of a recording the next one, which after the
    last is the first again. `name` is the sensor's; where None, one is made of the source.

    Raises
    ------
    CaptureError
        Where the source cannot be opened, or a live sensor went away.
    """
    cv2.setNumThreads(1)
    sensor = SensorReader(uri, calibration)
    with StopSignal() as stop, Background[RgbdFrame | None]("sensor") as driver:
        try:
            with HubConnection(settings, "capture", supervisor) as connection:
                _Capture(settings, connection, sensor, driver, name or sensor_name(uri)).serve(stop)
        finally:
            _close(driver, sensor)
        return stop.exit_status


def _close(driver: Background[RgbdFrame | None], sensor: SensorReader) -> None:
    if not driver.wait(_CLOSING_S):
        _log.error("the driver hangs", source=sensor.uri)
        exit_now(1)
    with suppress(CaptureError):
        if driver:
            driver.result()
    driver.start(sensor.close)
    driver.result()


@dataclass
class _UnacknowledgedFrame:
    """A frame that is sent again and again until the hub answers."""

    frame: RgbdFrame
    pause_s: float
    """From the last time it was sent until `due`."""
    due: float = 0.0
    """When to send it again, by the monotonic clock, seconds."""


@dataclass
class _Capture:
    settings: ServiceSettings
    connection: HubConnection
    sensor: SensorReader
    driver: Background[RgbdFrame | None]
    name: str = "sensor"
    open: bool = False
    presses: deque[str] = field(default_factory=deque)
    """Captures that wait for their frame, oldest first."""
    preview_due: bool = False
    peeking: bool = False
    """Whether the driver's call is for a preview."""
    unacknowledged: dict[str, _UnacknowledgedFrame] = field(default_factory=dict)
    """Frames sent that the hub has neither accepted nor refused, by capture."""

    def serve(self, stop: StopSignal) -> None:
        self.driver.start(self.sensor.open)
        for packet in self.connection.packets(stop, self.driver, lambda: None):
            if packet is not None:
                self._receive(packet)
            if self.driver.done():
                self._finish_call()
            elif self.driver.elapsed_s > self.settings.take_timeout_s:
                _log.error("the driver hangs", source=self.sensor.uri,
                           seconds=self.driver.elapsed_s)
                exit_now(1)
            if self.presses and not self.driver:
                self.driver.start(self.sensor.take)
            elif self.preview_due and not self.driver and not self.unacknowledged:
                self.peeking = True
                self.driver.start(self.sensor.peek)
            self._resend()

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case messages.Announce():
                if self.open:
                    self._send_ready()
            case messages.Take(capture_id=capture_id):
                failpoint("capture.take.received")
                if capture_id in self.unacknowledged:
                    self._transmit(capture_id)
                elif capture_id not in self.presses:
                    self.presses.append(capture_id)
            case messages.TakePreview():
                self.preview_due = True
            case messages.FrameAccepted(capture_id=capture_id):
                self.unacknowledged.pop(capture_id, None)
            case messages.FrameRefused(capture_id=capture_id, message=reason):
                _log.warning("frame refused", capture_id=capture_id, reason=reason)
                self.unacknowledged.pop(capture_id, None)

    def _send_ready(self) -> None:
        self.connection.send(messages.SensorReady(name=self.name, source=self.sensor.uri))

    def _finish_call(self) -> None:
        if not self.open:
            self.driver.result()
            self.open = True
            _log.info("source open", source=self.sensor.uri)
            self._send_ready()
            return
        peeking, self.peeking = self.peeking, False
        try:
            frame = self.driver.result()
        except CaptureError as error:
            self._call_failed(error, peeking=peeking)
            return
        if frame is None:
            return
        # A live sensor's frame that came after a press is the press's, for whatever it was taken.
        if self.presses and (not peeking or self.sensor.live):
            self._taken(self.presses.popleft(), frame)
        if self.preview_due and not self.presses and (peeking or self.sensor.live):
            self.preview_due = False
            self._send_preview(frame)

    def _taken(self, capture_id: str, frame: RgbdFrame) -> None:
        failpoint("capture.frame.taken")
        try:
            check_frame_size(frame, self.settings.max_frame_pixels)
        except FrameTooLargeError as error:
            self._no_frame(capture_id, error)
            return
        _log.info("taken", capture_id=capture_id, skew_us=frame.skew_us)
        self.unacknowledged[capture_id] = _UnacknowledgedFrame(frame, self.settings.resend_s)
        self._transmit(capture_id)

    def _no_frame(self, capture_id: str, error: Exception) -> None:
        _log.error("no frame", capture_id=capture_id, reason=str(error))
        self.connection.send(messages.FrameFailed(
            capture_id=capture_id, message=str(error)[:4000]))

    def _call_failed(self, error: CaptureError, *, peeking: bool) -> None:
        if peeking:
            self.preview_due = False
            _log.warning("no preview", reason=str(error))
        else:
            self._no_frame(self.presses.popleft(), error)
        if isinstance(error, SensorError):
            raise error

    def _send_preview(self, frame: RgbdFrame) -> None:
        header, arrays = PreviewHeader.of_jpeg(preview_jpeg(frame), frame.color_timestamp_us)
        self.connection.send(messages.PreviewFrame(preview=header), arrays)

    def _transmit(self, capture_id: str) -> None:
        sent = self.unacknowledged[capture_id]
        sent.due = time.monotonic() + sent.pause_s
        header, arrays = FrameHeader.of(sent.frame)
        self.connection.send(messages.Frame(capture_id=capture_id, frame=header), arrays)
        failpoint("capture.frame.sent")

    def _resend(self) -> None:
        """Send frames again that got no answer: the hub accepts each or says it is not wanted."""
        now = time.monotonic()
        for capture_id, sent in self.unacknowledged.items():
            if now >= sent.due:
                sent.pause_s = min(2 * sent.pause_s, _MAX_RESEND_S)
                _log.warning("frame not acknowledged, sent again", capture_id=capture_id,
                             next_in_s=sent.pause_s)
                self._transmit(capture_id)


def sensor_name(source: str, identity: str = "") -> str:
    """Make a sensor's name of its identity where that is known, else of its source."""
    scheme, colon, rest = source.partition(":")
    known = identity or (rest or scheme if colon else Path(source).stem)
    return re.sub(r"[^!-~]", "-", known)[:100] or "sensor"
