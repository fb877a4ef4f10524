"""From a press to a frame that is safe on the disk, or to a refusal."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from typing import NamedTuple, TypeAlias

import structlog

from denseface.recon.settings import Settings
from denseface.service.errors import FrameTooLargeError, ServiceError, StoreError
from denseface.service.hub import sensors
from denseface.service.hub._common import LOCAL, Common
from denseface.service.hub.withdrawn import Withdrawn
from denseface.service.monitoring import Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, send
from denseface.service.protocol.states import CaptureEvent, CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.failpoints import failpoint
from denseface.service.settings import check_frame_size
from denseface.service.storage import PendingWrite, WriteResult

_MIB = 2**20
"""Bytes."""
_MAX_REFUSALS = 1000
"""Refusals of one key that are remembered for a repeat of their request."""
_MAX_PRESSES_PER_KEY = 64
"""Presses of one key that may wait for their frame; beyond, they are refused."""
_MAX_PRESSERS = 64
"""Clients that are told what became of one press; others hear it when they repeat theirs."""
_MAX_SAVING = 32
"""Frames in memory that are being written; beyond, presses are refused."""


def settings_hash(settings: Settings) -> str:
    """Name settings in 16 hexadecimal digits."""
    return sha256(settings.model_dump_json().encode()).hexdigest()[:16]


_Refusals: TypeAlias = BoundedDict[tuple[bytes, str, int], messages.PressRefused]
"""How the last requests were refused, so that a repeat of one gets the same answer."""


class _Presser(NamedTuple):
    request: int
    """The last one."""
    key: str


@dataclass
class _Press:
    """A capture whose frame is not yet on the disk."""

    sensor: bytes
    deadline: float
    """Until then the frame is to come, and then to be written; seconds."""
    patience_s: float
    """How long the frame was waited for."""
    gated: bool
    """Whether the sensor may wait for a frame that is good enough."""
    key: str
    """Fingerprint of the first presser's key; empty where it needed none."""
    consent: messages.Consent | None = None
    """That came with the first press."""
    pressers: dict[bytes, _Presser] = field(default_factory=dict)
    """The clients that pressed this id."""
    frame_sender: bytes | None = None
    """The sensor whose frame is being written; None before it came."""
    late: bool = False
    """Whether the disk has not answered for so long that nobody waits for it any more."""


class Presses:
    """Captures whose frame is awaited or being written."""

    def __init__(
        self, common: Common, recon: Settings, accepted: Callable[[str], None], sensors_due: float,
        rejections: Rejections,
    ) -> None:
        """Take presses.

        Parameters
        ----------
        recon : settings of their jobs
        accepted : called with each capture whose frame is safe
        sensors_due : until then a missing sensor may just not have connected yet, seconds
        rejections : counts answers of sensors that were not asked
        """
        self._store, self._captures, self._writer, self._peers, self._settings = common
        self._accepted = accepted
        self._sensors_due = sensors_due
        self._rejections = rejections
        self._recon = recon
        self._recon_hash = settings_hash(recon)
        self._presses: dict[str, _Press] = {}
        self._refused: defaultdict[str, _Refusals] = defaultdict(
            lambda: BoundedDict(_MAX_REFUSALS))
        """By key: nobody makes the hub forget what it said to another."""
        self.withdrawn = Withdrawn()
        """What nobody may press again."""
        self._failed: list[tuple[PendingWrite, ServiceError]] = []
        """Frames that could not be saved, and are not refused yet."""
        self._log = structlog.get_logger("hub")

    def __len__(self) -> int:
        return len(self._presses)

    @property
    def disk_hangs(self) -> bool:
        """Whether a frame is being written for longer than anybody waits."""
        return any(press.late for press in self._presses.values())

    def press(
        self, now: float, peer: bytes, message: messages.Press, queued: int, key: str = ""
    ) -> Iterator[Output]:
        """Ask a sensor for a frame, unless this id is known already."""
        capture_id, request = message.capture_id, message.request
        if refused := self._refused[key].get((peer, capture_id, request)):
            # A repeat that crossed its answer: the client has told its user already.
            yield send(peer, refused)
            return
        if self.withdrawn.has(key, capture_id):
            yield from self._refuse_all(
                capture_id, {peer: _Presser(request, key)}, "purged", "it was withdrawn")
            return
        if press := self._presses.get(capture_id):
            yield from self._press_again(press, peer, _Presser(request, key))
            return
        if self._store.retention.is_erasing(capture_id):
            return  # the client repeats it in a moment
        if not self._captures.allows(capture_id, CaptureEvent.PRESSED):
            yield send(peer, messages.PressAccepted(request=request, capture_id=capture_id))
            return
        sensor = self._peers.sensor(message.sensor)
        missing = None if sensor else sensors.why_none(self._peers.sensors.values(), message.sensor)
        if sensor is None and missing is None and now < self._sensors_due:
            return  # the client repeats it in a moment
        presser = _Presser(request, key)
        obstacle = self.obstacle(queued, key)
        if sensor is None or obstacle:
            reason, why = obstacle or ("no_sensor", missing or self._not_there(message.sensor))
            yield from self._refuse_all(capture_id, {peer: presser}, reason, why)
            return
        self._captures.advance(capture_id, CaptureEvent.PRESSED)
        self._log.info("pressed", capture_id=capture_id, sensor=sensor.name, key=key or LOCAL)
        waits = message.gate in {"wait", "best"}
        patience_s = self._settings.take_timeout_s + (message.gate_timeout if waits else 0.0)
        self._presses[capture_id] = _Press(
            sensor.peer, now + patience_s, patience_s, waits, key, message.consent,
            {peer: presser})
        yield send(sensor.peer, messages.Take(
            capture_id=capture_id, gate=message.gate, gate_timeout=message.gate_timeout,
            frames=message.frames))

    def pressed_by(self, capture_id: str) -> str | None:
        """Give the fingerprint of the key that pressed a capture first, accepted yet or not.

        Empty where it needed none, None where there is no such capture; StoreError where it cannot
        be read.
        """
        if press := self._presses.get(capture_id):
            return press.key
        stored = self._store.find(capture_id)
        return stored.pressed_by if stored else None

    def asked_sensors(self) -> set[bytes]:
        """Return the sensors that are to send a frame at once."""
        return {press.sensor for press in self._presses.values()
                if press.frame_sender is None and not press.gated}

    def _not_there(self, name: str | None) -> str:
        if name is None:
            return "no sensor is connected"
        there = sensors.names_of(self._peers.sensors.values())
        return f"no sensor {name} is connected; there: {there}"

    def _press_again(self, press: _Press, peer: bytes, presser: _Presser) -> Iterator[Output]:
        if peer in press.pressers or len(press.pressers) < _MAX_PRESSERS:
            press.pressers[peer] = presser
        if press.late:
            yield self._not_known(peer, presser)

    def obstacle(self, queued: int, key: str = "") -> tuple[messages.PressReason, str] | None:
        """Give why a press is refused now whatever the sensor, in a word and in words, or None."""
        if queued + len(self) >= self._settings.queue:
            return "queue", f"{self._settings.queue} frames wait for a worker already"
        own = sum(press.key == key for press in self._presses.values()) if key else 0
        if own >= _MAX_PRESSES_PER_KEY:
            why = f"{own} presses of this key wait for their frame already"
            self._rejections.note("limit", key=key, detail=why)
            return "queue", why
        if self.disk_hangs:
            return "disk", f"the disk does not answer ({self._settings.take_timeout_s:g} s)"
        if sum(press.frame_sender is not None for press in self._presses.values()) >= _MAX_SAVING:
            return "disk", f"{_MAX_SAVING} frames wait for the disk already"
        if self._failed:
            return "disk", str(self._failed[0][1])
        try:
            free = self._store.free_bytes() // _MIB
        except StoreError as error:
            return "disk", str(error)
        if free < self._settings.reserve_mib:
            return "disk", (
                f"no room on the disk ({free} MiB free, {self._settings.reserve_mib} MiB are "
                "to stay free for the faces of what was accepted)")
        return None

    def frame(
        self, now: float, peer: bytes, message: messages.Frame, packet: Packet
    ) -> Iterator[Output]:
        """Begin to save a frame; `written` is told what came of it."""
        failpoint("hub.frame.received")
        capture_id = message.capture_id
        state = self._captures.state(capture_id)
        if state is CaptureState.SAVING_FRAME:  # a repeat; it is answered when the first is safe
            return
        if not self._captures.allows(capture_id, CaptureEvent.FRAME_RECEIVED):
            yield send(peer, messages.FrameAccepted(capture_id=capture_id) if state else
                       messages.FrameRefused(capture_id=capture_id, message="nobody waits for it"))
            return
        press = self._presses[capture_id]
        if peer != press.sensor:
            self._not_asked(capture_id)
            yield send(peer, messages.FrameRefused(
                capture_id=capture_id, message="another sensor was asked"))
            return
        try:
            check_frame_size(message.frame.calibration, self._settings.max_frame_pixels)
        except FrameTooLargeError as error:
            yield send(peer, messages.FrameRefused(capture_id=capture_id, message=str(error)))
            yield from self._refuse(capture_id, "sensor", str(error))
            return
        self._peers.doubt(peer, doubted=False)
        press.frame_sender, press.deadline = peer, now + self._settings.take_timeout_s
        self._captures.advance(capture_id, CaptureEvent.FRAME_RECEIVED)
        try:
            pending = self._store.prepare_frame(
                packet, self._recon, self._recon_hash, press.key, press.consent)
        except StoreError as error:
            yield from self._not_saved(capture_id, error)
            return
        self._writer.start(pending)

    def written(self, frames: Sequence[WriteResult]) -> Iterator[Output]:
        """Give frames their rows, and answer their sensors and all who pressed."""
        for one, error in self._captures.save(CaptureEvent.FRAME_SAVED, frames):
            if error is None:
                yield from self._saved(one.pending.capture_id)
            elif isinstance(error, ServiceError):
                self._failed.append((one.pending, error))
            else:
                raise error
        with suppress(StoreError):
            yield from self.refuse_failed()

    def refuse_failed(self) -> Iterator[Output]:
        """Refuse the frames that could not be saved.

        StoreError, and no answer to anyone, while the next hub might find one of them accepted.
        """
        if not self._failed:
            return
        self._store.refuse([pending for pending, _ in self._failed])
        failed, self._failed = self._failed, []
        for pending, error in failed:
            yield from self._not_saved(pending.capture_id, error)

    def _saved(self, capture_id: str) -> Iterator[Output]:
        self._log.info("accepted", capture_id=capture_id)
        press = self._presses.pop(capture_id)
        self._accepted(capture_id)
        if press.frame_sender is not None:
            yield send(press.frame_sender, messages.FrameAccepted(capture_id=capture_id))
        for peer, presser in press.pressers.items():
            yield send(peer, messages.PressAccepted(
                request=presser.request, capture_id=capture_id))

    def _not_saved(self, capture_id: str, error: Exception) -> Iterator[Output]:
        if (sender := self._presses[capture_id].frame_sender) is not None:
            yield send(sender, messages.FrameRefused(capture_id=capture_id, message=str(error)))
        yield from self._refuse(capture_id, "disk", str(error))

    def frame_failed(self, peer: bytes, message: messages.FrameFailed) -> Iterator[Output]:
        """Refuse a press for which the sensor that was asked has no frame."""
        if self._captures.state(message.capture_id) is not CaptureState.PRESSED:
            return
        if peer != self._presses[message.capture_id].sensor:
            self._not_asked(message.capture_id)
            return
        yield from self._refuse(
            message.capture_id, message.reason, message.message, hint=message.hint)

    def _not_asked(self, capture_id: str) -> None:
        self._rejections.note(
            "not asked", capture_id=capture_id, detail="a sensor answered for another one")

    def _refuse(
        self, capture_id: str, reason: messages.PressReason, why: str,
        event: CaptureEvent = CaptureEvent.REFUSED, hint: messages.Hint | None = None,
    ) -> Iterator[Output]:
        """End a press without a capture and tell all who pressed."""
        if press := self._presses.pop(capture_id, None):
            self._captures.advance(capture_id, event)
            yield from self._refuse_all(capture_id, press.pressers, reason, why, hint)

    def _refuse_all(
        self, capture_id: str, pressers: Mapping[bytes, _Presser], reason: messages.PressReason,
        why: str, hint: messages.Hint | None = None,
    ) -> Iterator[Output]:
        whose = next((one.key for one in pressers.values()), "") or LOCAL
        self._log.warning("press refused", capture_id=capture_id, reason=why, key=whose)
        for peer, (request, key) in pressers.items():
            refused = messages.PressRefused(
                request=request, capture_id=capture_id, reason=reason, message=why, hint=hint)
            self._refused[key][peer, capture_id, request] = refused
            yield send(peer, refused)

    def purge(
        self, capture_id: str | None, why: str = "purged by an operator"
    ) -> Iterator[Output]:
        """Refuse one press whose frame is awaited, or all where None."""
        for waiting in [capture_id] if capture_id else list(self._presses):
            yield from self._refuse(waiting, "purged", why, CaptureEvent.PURGED)

    def sensor_gone(self, peer: bytes, reason: str) -> Iterator[Output]:
        """Refuse the presses that a sensor was asked for."""
        for capture_id in [key for key, press in self._presses.items()
                           if press.sensor == peer and press.frame_sender is None]:
            yield from self._refuse(capture_id, "sensor_gone", f"the sensor went away ({reason})")

    def tick(self, now: float) -> Iterator[Output]:
        """Refuse presses whose frame is late; let nobody wait for a disk that does not answer."""
        with suppress(StoreError):
            yield from self.refuse_failed()
        for capture_id, press in list(self._presses.items()):
            if now >= press.deadline and press.frame_sender is None:
                self._peers.doubt(press.sensor)
                yield from self._refuse(
                    capture_id, "timeout", f"no frame from the sensor in {press.patience_s:g} s")
        for capture_id, press in self._presses.items():
            if now < press.deadline or press.late or press.frame_sender is None:
                continue
            press.late = True
            self._log.error("disk does not answer", capture_id=capture_id)
            for peer, presser in press.pressers.items():
                yield self._not_known(peer, presser)

    def _not_known(self, peer: bytes, presser: _Presser) -> Output:
        """Say that nobody can say whether there will be a capture: its file may appear yet."""
        return send(peer, messages.RequestFailed(request=presser.request, message=(
            f"the disk has not answered for {self._settings.take_timeout_s:g} s; whether the frame "
            "is kept is not known, press the same id again to learn it")))
