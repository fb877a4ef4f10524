"""The capture process: the only one that touches a sensor or OpenNI2.

The driver is called in a thread of its own, so that this process answers the hub while it waits.
A driver that hangs ends the process; the supervisor starts another.
"""

import os
import socket
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import structlog
from numpy.typing import NDArray

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.errors import SensorError
from denseface.service.daemons.sensor import SensorReader
from denseface.service.protocol.messages import (
    Announce,
    Frame,
    FrameAccepted,
    FrameFailed,
    FrameRefused,
    PreviewFrame,
    SensorReady,
    Take,
    TakePreview,
)
from denseface.service.protocol.payload import MAX_PREVIEW_SIDE, FrameHeader, PreviewHeader
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.settings import ServiceSettings
from denseface.service.transport.hub_connection import HubConnection

__all__ = ["run"]

_CLOSING_S = 3.0
"""Longest wait for the driver's last call when the process stops, seconds."""
_MAX_RESEND_S = 30.0
"""Longest pause before a frame that is not acknowledged is sent again, seconds."""


def run(settings: ServiceSettings, uri: str, calibration: Path | None = None) -> int:
    """Serve frames of a source until SIGINT or SIGTERM and give the exit status.

    A press gets the newest frame of a live sensor; of a recording the next one, which after the
    last is the first again.

    Raises
    ------
    CaptureError
        Where the source cannot be opened, or a live sensor went away.
    """
    cv2.setNumThreads(1)
    sensor = SensorReader(uri, calibration)
    with StopSignal() as stop, Background[RgbdFrame | None]("sensor") as driver:
        try:
            with HubConnection(settings, "capture") as connection:
                _Capture(settings, connection, sensor, driver).serve(stop)
        finally:
            _close(driver, sensor)
        return stop.exit_status


def _close(driver: Background[RgbdFrame | None], sensor: SensorReader) -> None:
    if not driver.wait(_CLOSING_S):
        structlog.get_logger("capture").error("the driver hangs", source=sensor.uri)
        os._exit(1)
    with suppress(CaptureError):
        if driver:
            driver.result()
    driver.start(sensor.close)
    driver.result()


@dataclass
class _UnacknowledgedFrame:
    """A frame that is sent again and again until the hub answers."""

    frame: RgbdFrame
    due: float
    """When to send it again, by the monotonic clock, seconds."""
    pause_s: float
    """From the last time it was sent until `due`."""


class _Capture:
    def __init__(
        self, settings: ServiceSettings, connection: HubConnection, sensor: SensorReader,
        driver: Background[RgbdFrame | None],
    ) -> None:
        self._settings = settings
        self._connection = connection
        self._sensor = sensor
        self._driver = driver
        self._log = structlog.get_logger("capture")
        self._open = False
        self._presses: deque[str] = deque()
        """Captures that wait for their frame, oldest first."""
        self._preview_due = False
        self._peeking = False
        """Whether the driver's call is for a preview."""
        self._unacknowledged: dict[str, _UnacknowledgedFrame] = {}
        """Frames sent that the hub has neither accepted nor refused, by capture."""

    def serve(self, stop: StopSignal) -> None:
        self._driver.start(self._sensor.open)
        for packet in self._connection.packets(stop, self._driver, lambda: None):
            if packet is not None:
                self._receive(packet)
            if self._driver.done():
                self._finish_call()
            elif self._driver.elapsed_s > self._settings.take_timeout_s:
                self._log.error("the driver hangs", source=self._sensor.uri,
                                seconds=self._driver.elapsed_s)
                os._exit(1)
            if self._presses and not self._driver:
                self._driver.start(self._sensor.take)
            elif self._preview_due and not self._driver and not self._unacknowledged:
                self._peeking = True
                self._driver.start(self._sensor.peek)
            self._resend()

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if self._open:
                    self._send_ready()
            case Take(capture_id=capture_id):
                failpoint("capture.take.received")
                if capture_id in self._unacknowledged:
                    self._transmit(capture_id)
                elif capture_id not in self._presses:
                    self._presses.append(capture_id)
            case TakePreview():
                self._preview_due = True
            case FrameAccepted(capture_id=capture_id):
                self._unacknowledged.pop(capture_id, None)
            case FrameRefused(capture_id=capture_id, message=reason):
                self._log.warning("frame refused", capture_id=capture_id, reason=reason)
                self._unacknowledged.pop(capture_id, None)

    def _send_ready(self) -> None:
        self._connection.send(SensorReady(
            name=f"{socket.gethostname()}/{os.getpid()}", source=self._sensor.uri))

    def _finish_call(self) -> None:
        if not self._open:
            self._driver.result()
            self._open = True
            self._log.info("source open", source=self._sensor.uri)
            self._send_ready()
            return
        peeking, self._peeking = self._peeking, False
        try:
            frame = self._driver.result()
        except CaptureError as error:
            self._call_failed(error, peeking=peeking)
            return
        if frame is None:
            return
        # A live sensor's frame that came after a press is the press's, for whatever it was taken.
        if self._presses and (not peeking or self._sensor.live):
            capture_id = self._presses.popleft()
            failpoint("capture.frame.taken")
            self._log.info("taken", capture_id=capture_id, skew_us=frame.skew_us)
            self._send(capture_id, frame)
        if self._preview_due and not self._presses and (peeking or self._sensor.live):
            self._preview_due = False
            self._send_preview(frame)

    def _call_failed(self, error: CaptureError, *, peeking: bool) -> None:
        if peeking:
            self._preview_due = False
            self._log.warning("no preview", reason=str(error))
        else:
            capture_id = self._presses.popleft()
            self._log.error("no frame", capture_id=capture_id, reason=str(error))
            self._connection.send(FrameFailed(capture_id=capture_id, message=str(error)[:4000]))
        if isinstance(error, SensorError):
            raise error

    def _send_preview(self, frame: RgbdFrame) -> None:
        image = _preview_image(frame.color)
        height, width, _ = image.shape
        self._connection.send(PreviewFrame(preview=PreviewHeader(
            width=width, height=height, timestamp_us=frame.color_timestamp_us)),
            {"image": image})

    def _send(self, capture_id: str, frame: RgbdFrame) -> None:
        self._unacknowledged[capture_id] = _UnacknowledgedFrame(
            frame, due=0.0, pause_s=self._settings.resend_s)
        self._transmit(capture_id)

    def _transmit(self, capture_id: str) -> None:
        sent = self._unacknowledged[capture_id]
        sent.due = time.monotonic() + sent.pause_s
        header, arrays = FrameHeader.of(sent.frame)
        self._connection.send(Frame(capture_id=capture_id, frame=header), arrays)
        failpoint("capture.frame.sent")

    def _resend(self) -> None:
        """Send frames again that got no answer: the hub accepts each or says it is not wanted."""
        now = time.monotonic()
        for capture_id, sent in self._unacknowledged.items():
            if now >= sent.due:
                sent.pause_s = min(2 * sent.pause_s, _MAX_RESEND_S)
                self._log.warning("frame not acknowledged, sent again", capture_id=capture_id,
                                  next_in_s=sent.pause_s)
                self._transmit(capture_id)


def _preview_image(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink (h, w, 3) by a whole factor, to no side above `MAX_PREVIEW_SIDE`: means of areas."""
    height, width = color.shape[:2]
    factor = -(-max(height, width) // MAX_PREVIEW_SIDE)
    size = max(width // factor, 1), max(height // factor, 1)
    return np.asarray(cv2.resize(color, size, interpolation=cv2.INTER_AREA), np.uint8)
