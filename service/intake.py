"""The hub's first half: a press becomes a frame that is safe on the disk, or is refused."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import structlog

from recon.settings import Settings
from service import messages
from service.errors import StoreError
from service.failpoints import failpoint
from service.outputs import Output, send
from service.roster import Roster
from service.settings import ServiceSettings
from service.states import CaptureEvent, CaptureState, advance
from service.stored import Store
from service.wire import Packet

__all__ = ["Intake"]

_MIB = 2**20
_REFUSALS = 1000


@dataclass
class _Press:
    """A press that waits for its frame; not on the disk, so it is lost with the hub."""

    sensor: bytes
    deadline: float
    key: str
    """Fingerprint of the first presser's key; empty where it needed none."""
    pressers: dict[bytes, int] = field(default_factory=dict)
    """The last request of each client that pressed this id."""


class Intake:
    """Presses that wait for their frame."""

    def __init__(
        self, store: Store, roster: Roster, settings: ServiceSettings, recon: Settings,
        recon_hash: str,
    ) -> None:
        self._store = store
        self._roster = roster
        self._settings = settings
        self._recon = recon
        self._recon_hash = recon_hash
        self._presses: dict[str, _Press] = {}
        self._refused: dict[tuple[bytes, str, int], messages.PressRefused] = {}
        """How the last requests were refused, so that a repeat of one gets the same answer."""
        self._log = structlog.get_logger("hub")

    def __len__(self) -> int:
        return len(self._presses)

    def press(
        self, now: float, peer: bytes, message: messages.Press, queued: int, key: str = ""
    ) -> Iterator[Output]:
        """Ask a sensor for a frame, unless this id is known already."""
        capture_id, request = message.capture_id, message.request
        if refused := self._refused.get((peer, capture_id, request)):
            # A repeat that was under way when the client had its answer: it has told its user.
            yield send(peer, refused)
            return
        state = self._state(capture_id)
        if state is CaptureState.PRESSED:
            self._presses[capture_id].pressers[peer] = request
            return
        if state is not None:
            yield send(peer, messages.PressAccepted(request=request, capture_id=capture_id))
            return
        sensor = self._roster.sensor()
        obstacle = self._obstacle(queued)
        if sensor is None or obstacle:
            reason, why = obstacle or ("no_sensor", "no sensor is connected")
            self._log.warning("press refused", capture_id=capture_id, reason=why)
            yield self._refusal(peer, messages.PressRefused(
                request=request, capture_id=capture_id, reason=reason, message=why))
            return
        self._log.info("pressed", capture_id=capture_id, sensor=sensor.name)
        deadline = now + self._settings.take_timeout_s
        self._presses[capture_id] = _Press(sensor.peer, deadline, key, {peer: request})
        yield send(sensor.peer, messages.Take(capture_id=capture_id))

    def _obstacle(self, queued: int) -> tuple[messages.PressReason, str] | None:
        if queued + len(self) >= self._settings.queue:
            return "queue", f"{self._settings.queue} frames wait for a worker already"
        try:
            free = self._store.free_bytes() // _MIB
        except StoreError as error:
            return "disk", str(error)
        if free < self._settings.reserve_mib:
            return "disk", (
                f"no room on the disk ({free} MiB free, {self._settings.reserve_mib} MiB are "
                "to stay free for the faces of what was accepted)")
        return None

    def frame(self, peer: bytes, message: messages.Frame, packet: Packet) -> Iterator[Output]:
        """Keep a frame, then say so: to the sensor and to all who pressed."""
        failpoint("hub.frame.received")
        capture_id = message.capture_id
        state = self._state(capture_id)
        if advance(state, CaptureEvent.STORED) is None:
            yield send(peer, messages.FrameAccepted(capture_id=capture_id) if state else
                       messages.FrameRefused(capture_id=capture_id, message="nobody waits for it"))
            return
        try:
            self._store.accept(
                packet, self._recon, self._recon_hash, self._presses[capture_id].key)
        except StoreError as error:
            yield send(peer, messages.FrameRefused(capture_id=capture_id, message=str(error)))
            yield from self.refuse(capture_id, "disk", str(error))
            return
        self._log.info("accepted", capture_id=capture_id)
        yield send(peer, messages.FrameAccepted(capture_id=capture_id))
        for presser, request in self._presses.pop(capture_id).pressers.items():
            yield send(presser, messages.PressAccepted(request=request, capture_id=capture_id))

    def refuse(
        self, capture_id: str, reason: messages.PressReason, why: str
    ) -> Iterator[Output]:
        """Tell all who pressed that there is no capture."""
        if press := self._presses.pop(capture_id, None):
            self._log.warning("press refused", capture_id=capture_id, reason=why)
            for presser, request in press.pressers.items():
                yield self._refusal(presser, messages.PressRefused(
                    request=request, capture_id=capture_id, reason=reason, message=why))

    def _refusal(self, peer: bytes, refused: messages.PressRefused) -> Output:
        self._refused[peer, refused.capture_id, refused.request] = refused
        if len(self._refused) > _REFUSALS:
            del self._refused[next(iter(self._refused))]
        return send(peer, refused)

    def purge(self, capture_id: str | None) -> Iterator[Output]:
        """Refuse one press, or all where None, whose frame is no longer wanted."""
        for waiting in [capture_id] if capture_id else list(self._presses):
            yield from self.refuse(waiting, "purged", "purged by an operator")

    def sensor_gone(self, peer: bytes, reason: str) -> Iterator[Output]:
        """Refuse what a sensor that went away was asked for."""
        for capture_id in [key for key, press in self._presses.items() if press.sensor == peer]:
            yield from self.refuse(
                capture_id, "sensor_gone", f"the sensor went away ({reason})")

    def tick(self, now: float) -> Iterator[Output]:
        """Refuse what took too long."""
        late = [key for key, press in self._presses.items() if now >= press.deadline]
        for capture_id in late:
            limit = self._settings.take_timeout_s
            yield from self.refuse(
                capture_id, "timeout", f"no frame from the sensor in {limit:g} s")

    def _state(self, capture_id: str) -> CaptureState | None:
        if capture_id in self._presses:
            return CaptureState.PRESSED
        stored = self._store.find(capture_id)
        return stored.state if stored else None
