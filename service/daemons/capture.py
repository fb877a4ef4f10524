"""The capture process: the only one that touches a sensor or OpenNI2.

The driver is called in a thread of its own, so that this process answers the hub while it waits,
also while there is no sensor. A driver that hangs ends the process; the supervisor starts another.
"""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import structlog

from denseface.capture import RgbdFrame
from denseface.capture.live.sensor import open_sensor
from denseface.recon.numerics.malloc import share_heaps
from denseface.service.daemons._frame_sender import FrameSender
from denseface.service.daemons._live_supply import LiveSupply
from denseface.service.daemons._reader_supply import JudgedFrame, ReaderSupply
from denseface.service.daemons._supply import Hinted, NotTaken, Picture, Supply, SupplyState, Taken
from denseface.service.daemons.preview_picture import preview_jpeg
from denseface.service.daemons.sensor import SensorReader
from denseface.service.errors import FrameTooLargeError, in_one_line
from denseface.service.log.output import exit_now
from denseface.service.protocol import messages
from denseface.service.protocol.payload import PreviewHeader
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.settings import ServiceSettings, check_frame_size
from denseface.service.transport.hub_connection import HubConnection

__all__ = ["run", "sensor_name"]

_STATE_S = 1.0
"""Time after which the hub is told the state again, for its figures, seconds."""
_COMING = ("opening", "warming")
"""States that pass by themselves."""
_log = structlog.get_logger("capture")


def run(settings: ServiceSettings, uri: str, calibration: Path | None = None,
        supervisor: SupervisorLink | None = None, name: str | None = None, *,
        rotation: int = 0) -> int:
    """Serve frames of a source until SIGINT or SIGTERM and give the exit status.

    A press gets the first frame of a live sensor that was exposed after it; of a recording the
    next one, which after the last is the first again. `name` is the sensor's; where None, one is
    made of its identity or the source.

    Raises
    ------
    CaptureError
        Where a recording cannot be opened or read. A sensor that is not there is waited for.
    """
    cv2.setNumThreads(1)
    share_heaps()
    supervisor = supervisor or SupervisorLink()
    with StopSignal() as stop:
        while not stop:
            with _supply(settings, uri, calibration, rotation) as supply:
                try:
                    with HubConnection(settings, "capture", supervisor) as connection:
                        _Capture(settings, connection, supply, uri, name, supervisor).serve(stop)
                except Exception as error:
                    supervisor.say_why(in_one_line(error))
                    raise
                finally:
                    if not supply.close():
                        _log.error("the driver hangs", source=uri, reason="it does not close")
                        exit_now(stop.exit_status if stop else 1)
            if supervisor.supervised:  # told to restart, it is started anew with its driver
                break
        return stop.exit_status


@contextmanager
def _supply(
    settings: ServiceSettings, uri: str, calibration: Path | None, rotation: int
) -> Iterator[Supply]:
    if sensor := open_sensor(
            uri, calibration, rotation=rotation, transport_s=settings.sensor_delay_ms / 1e3):
        yield LiveSupply(sensor, settings.take_timeout_s / 2)
        return
    with Background[JudgedFrame | None]("sensor") as driver:
        reader = SensorReader(uri, calibration, rotation)
        yield ReaderSupply(reader, driver, settings.take_timeout_s)


@dataclass
class _Capture:
    """What the hub and a source have to do with each other."""

    settings: ServiceSettings
    connection: HubConnection
    supply: Supply
    uri: str
    name: str | None = None
    supervisor: SupervisorLink = field(default_factory=SupervisorLink)
    sender: FrameSender = field(init=False)
    said: SupplyState | None = None
    """The state that the hub was told last."""
    said_at: float = 0.0
    """When, monotonic clock, seconds."""
    logged: set[tuple[str, str]] = field(default_factory=set)
    """States and reasons that were logged since it streamed last: each is said once."""

    def __post_init__(self) -> None:
        self.sender = FrameSender(self.connection, self.settings.resend_s)

    def serve(self, stop: StopSignal) -> None:
        """Do so until `stop`, or until told to begin anew."""
        for packet in self.connection.packets(stop, self.supply.wake):
            if packet is not None:
                if isinstance(packet.message, messages.Restart):
                    _log.warning("told to begin anew", source=self.uri)
                    return
                self._receive(packet)
            if reason := self.supply.hangs():
                _log.error("another process is needed", source=self.uri, reason=reason)
                self.supervisor.say_why(reason)
                exit_now(1)
            for outcome in self.supply.step(busy=len(self.sender) > 0):
                match outcome:
                    case Taken(capture_id, frame):
                        self._taken(capture_id, frame)
                    case NotTaken(capture_id, reason, hint):
                        self._no_frame(capture_id, reason, hint)
                    case Picture(frame, hint):
                        self._send_preview(frame, hint)
                    case Hinted(hint):
                        self.connection.send(messages.QualityHint(hint=hint))
            self._tell_state()
            self.supervisor.manager.ready()
            self.sender.send_due()

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case messages.Announce():
                self.said = None
            case messages.Take(capture_id=capture_id) as take:
                failpoint("capture.take.received")
                if capture_id in self.sender:
                    self.sender.send_again(capture_id)
                else:
                    self.supply.press(take)
            case messages.TakePreview():
                self.supply.preview()
            case messages.TakeHints(seconds=seconds):
                self.supply.send_hints(seconds)
            case messages.FrameAccepted(capture_id=capture_id):
                self.sender.answered(capture_id)
            case messages.FrameRefused(capture_id=capture_id, message=reason):
                _log.warning("frame refused", capture_id=capture_id, reason=reason)
                self.sender.answered(capture_id)

    def _tell_state(self) -> None:
        """Tell the hub how the source is: at a change, and now and then for the figures."""
        state, said, now = self.supply.state, self.said, time.monotonic()
        changed = said is None or (said.state, said.reason) != (state.state, state.reason)
        if not changed and (state == said or now - self.said_at < _STATE_S):
            return
        sent = self.connection.send(messages.SensorState(
            name=self.name or sensor_name(self.uri, state.identity), state=state.state,
            reason=state.reason, identity=state.identity, figures=state.figures))
        if changed and sent:
            self.supervisor.manager.status(f"{state.state}{state.reason and f': {state.reason}'}")
        if changed and (state.state, state.reason) not in self.logged:
            if state.state == "streaming":
                self.logged.clear()
            self.logged.discard(("streaming", ""))
            self.logged.add((state.state, state.reason))
            say = _log.info if not state.reason or state.state in _COMING else _log.warning
            say("sensor", state=state.state, reason=state.reason, source=self.uri,
                identity=state.identity)
        self.said, self.said_at = state if sent else None, now

    def _taken(self, capture_id: str, frame: RgbdFrame) -> None:
        failpoint("capture.frame.taken")
        try:
            check_frame_size(frame.calibration, self.settings.max_frame_pixels)
        except FrameTooLargeError as error:
            self._no_frame(capture_id, str(error))
            return
        _log.info("taken", capture_id=capture_id, skew_us=frame.skew_us,
                  exposed_after_press_ms=frame.origin.exposed_after_press_ms)
        for note in frame.origin.notes:  # whoever runs the sensor reads no report
            _log.warning("doubtful", capture_id=capture_id, reason=note)
        self.sender.send(capture_id, frame)

    def _no_frame(
        self, capture_id: str, reason: str, hint: messages.Hint | None = None
    ) -> None:
        say = _log.error if hint is None else _log.info
        say("no frame", capture_id=capture_id, reason=reason)
        self.connection.send(messages.FrameFailed(
            capture_id=capture_id, message=reason[:4000],
            reason="sensor" if hint is None else "quality", hint=hint))

    def _send_preview(self, frame: RgbdFrame, hint: messages.Hint | None) -> None:
        header, arrays = PreviewHeader.of_jpeg(
            preview_jpeg(frame), frame.color_timestamp_us, hint)
        self.connection.send(messages.PreviewFrame(preview=header), arrays)


def sensor_name(source: str, identity: str = "") -> str:
    """Make a sensor's name of its identity where that is known, else of its source."""
    scheme, colon, rest = source.partition(":")
    known = identity or (rest or scheme if colon else Path(source).stem)
    return re.sub(r"[^!-~]", "-", known)[:100] or "sensor"
