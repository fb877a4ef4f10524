"""The capture process: the only one that touches a sensor or OpenNI2.

All of the driver is called in one thread, so that this process answers while the driver does not;
one that hangs ends the process, and the supervisor starts another.
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
"""Longest wait at the end for a frame under way, seconds."""
_LONGEST_PAUSE_S = 30.0
"""Between two tries to have the hub take a frame, seconds."""


def run(settings: ServiceSettings, uri: str, calibration: Path | None = None) -> int:
    """Serve frames of a source until SIGINT or SIGTERM and give the exit status.

    A live sensor gives its newest frame for each press; a recording gives its frames in order,
    one for each press, and starts over after the last.

    Raises
    ------
    CaptureError
        Where the source cannot be opened, or a live sensor went away.
    """
    cv2.setNumThreads(1)
    sensor = SensorReader(uri, calibration)
    with StopSignal() as stop, Background[RgbdFrame | None]("sensor") as driver:
        try:
            with HubConnection(settings, "capture") as link:
                _Capture(settings, link, sensor, driver).serve(stop)
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
class _Unsafe:
    """A frame that is sent until the hub says that it is safe."""

    frame: RgbdFrame
    due: float
    """When it is to be sent again, seconds."""
    pause_s: float


class _Capture:
    def __init__(
        self, settings: ServiceSettings, link: HubConnection, sensor: SensorReader,
        driver: Background[RgbdFrame | None],
    ) -> None:
        self._settings = settings
        self._link = link
        self._sensor = sensor
        self._driver = driver
        self._log = structlog.get_logger("capture")
        self._open = False
        self._asked: deque[str] = deque()
        self._preview_asked = False
        self._looking = False
        """The call under way is for a preview."""
        self._unsafe: dict[str, _Unsafe] = {}
        """Frames that the hub has not yet said are safe."""

    def serve(self, stop: StopSignal) -> None:
        self._driver.start(self._sensor.open)
        for packet in self._link.packets(stop, self._driver, lambda: None):
            if packet is not None:
                self._receive(packet)
            if self._driver.done():
                self._called()
            elif self._driver.elapsed_s > self._settings.take_timeout_s:
                self._log.error("the driver hangs", source=self._sensor.uri,
                                seconds=self._driver.elapsed_s)
                os._exit(1)
            if self._asked and not self._driver:
                self._driver.start(self._sensor.take)
            elif self._preview_asked and not self._driver and not self._unsafe:
                self._looking = True
                self._driver.start(self._sensor.peek)
            self._send_again()

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if self._open:
                    self._ready()
            case Take(capture_id=capture_id):
                failpoint("capture.take.received")
                if capture_id in self._unsafe:
                    self._send_once_more(capture_id)
                elif capture_id not in self._asked:
                    self._asked.append(capture_id)
            case TakePreview():
                self._preview_asked = True
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
            self._driver.result()
            self._open = True
            self._log.info("source open", source=self._sensor.uri)
            self._ready()
            return
        looking, self._looking = self._looking, False
        try:
            frame = self._driver.result()
        except CaptureError as error:
            self._no_frame(error, looking=looking)
            return
        if frame is None:
            return
        # What a live sensor gave after a press came in is for the press, whoever wanted it.
        if self._asked and (not looking or self._sensor.live):
            capture_id = self._asked.popleft()
            failpoint("capture.frame.taken")
            self._log.info("taken", capture_id=capture_id, skew_us=frame.skew_us)
            self._send(capture_id, frame)
        if self._preview_asked and not self._asked and (looking or self._sensor.live):
            self._preview_asked = False
            self._send_preview(frame)

    def _no_frame(self, error: CaptureError, *, looking: bool) -> None:
        if looking:
            self._preview_asked = False
            self._log.warning("no preview", reason=str(error))
        else:
            capture_id = self._asked.popleft()
            self._log.error("no frame", capture_id=capture_id, reason=str(error))
            self._link.send(FrameFailed(capture_id=capture_id, message=str(error)[:4000]))
        if isinstance(error, SensorError):
            raise error

    def _send_preview(self, frame: RgbdFrame) -> None:
        image = _preview_image(frame.color)
        height, width, _ = image.shape
        self._link.send(PreviewFrame(preview=PreviewHeader(
            width=width, height=height, timestamp_us=frame.color_timestamp_us)),
            {"image": image})

    def _send(self, capture_id: str, frame: RgbdFrame) -> None:
        self._unsafe[capture_id] = _Unsafe(frame, 0.0, self._settings.resend_s)
        self._send_once_more(capture_id)

    def _send_once_more(self, capture_id: str) -> None:
        unsafe = self._unsafe[capture_id]
        unsafe.due = time.monotonic() + unsafe.pause_s
        header, arrays = FrameHeader.of(unsafe.frame)
        self._link.send(Frame(capture_id=capture_id, frame=header), arrays)
        failpoint("capture.frame.sent")

    def _send_again(self) -> None:
        """Repeat what got no answer: the hub accepts it, or says that nobody waits any more."""
        now = time.monotonic()
        for capture_id, unsafe in self._unsafe.items():
            if now >= unsafe.due:
                unsafe.pause_s = min(2 * unsafe.pause_s, _LONGEST_PAUSE_S)
                self._log.warning("frame not acknowledged, sent again", capture_id=capture_id,
                                  next_in_s=unsafe.pause_s)
                self._send_once_more(capture_id)


def _preview_image(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink (h, w, 3) by a whole factor, to no side above `MAX_PREVIEW_SIDE`: means of areas."""
    height, width = color.shape[:2]
    factor = -(-max(height, width) // MAX_PREVIEW_SIDE)
    size = max(width // factor, 1), max(height // factor, 1)
    return np.asarray(cv2.resize(color, size, interpolation=cv2.INTER_AREA), np.uint8)
