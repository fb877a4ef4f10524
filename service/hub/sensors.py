"""The sensors that are connected to the hub: which of them a press goes to, or why to none."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from denseface.service.protocol.sensor_messages import LiveStateName, SensorFigures, SensorState
from denseface.service.protocol.status import SensorStatus
from denseface.service.runtime.terminal import printable

_ASKED: dict[LiveStateName, int] = {"streaming": 0, "warming": 1, "opening": 2}
"""States in which a sensor is asked for a frame, the best first: it has some, or will soon."""
_MAX_NAMED = 4
"""Sensors that a refusal speaks of."""
_MAX_REASON = 200
"""Characters of a reason in a status."""


@dataclass
class SensorPeer:
    """A capture process."""

    peer: bytes
    name: str
    seen: float
    """When it last said something, seconds."""
    key: str = ""
    """Fingerprint of its key; empty where it needed none."""
    state: LiveStateName = "streaming"
    """As it last said; one that says nothing of it has its source open."""
    reason: str = ""
    """Why it does not stream."""
    identity: str = ""
    figures: SensorFigures = field(default_factory=SensorFigures)
    doubted: bool = False
    """It was asked for a frame and none came in time, or another took its name."""

    @property
    def can_be_asked(self) -> bool:
        """Whether a press may go to it."""
        return self.state in _ASKED

    @property
    def streams(self) -> bool:
        """Whether it has pictures to show now."""
        return self.state == "streaming"

    def note(self, message: SensorState, now: float) -> bool:
        """Take what it says of itself; True where its state is another now."""
        changed = (self.state, self.reason) != (message.state, message.reason)
        self.name, self.seen, self.state = message.name, now, message.state
        self.reason, self.identity, self.figures = (
            message.reason, message.identity, message.figures)
        return changed

    def status(self) -> SensorStatus:
        """Give what a status says of it."""
        return SensorStatus(
            name=self.name, state=self.state, reason=printable(self.reason)[:_MAX_REASON],
            identity=printable(self.identity)[:_MAX_REASON], figures=self.figures)


def choose(sensors: Iterable[SensorPeer], name: str | None) -> SensorPeer | None:
    """Give the sensor to ask: of this name where there is one, the best off, of these the first.

    One that is doubted only where there is no other: whatever it says, it gave no frame.
    """
    asked = [one for one in sensors if one.can_be_asked and name in (None, one.name)]
    return min(asked, key=_rank, default=None)


def best_first(sensors: Iterable[SensorPeer]) -> list[SensorPeer]:
    """Sort sensors as `choose` prefers them; those that cannot be asked come last."""
    return sorted(sensors, key=_rank)


def _rank(sensor: SensorPeer) -> tuple[bool, bool, int]:
    state = _ASKED.get(sensor.state)
    return state is None, sensor.doubted, state or 0


def why_none(sensors: Iterable[SensorPeer], name: str | None) -> str | None:
    """Say in words why `choose` gives none; None where no such sensor is connected at all."""
    known = [one for one in sensors if name in (None, one.name)]
    if not known:
        return None
    whys = [f"the sensor {one.name} is {one.state}{one.reason and f': {one.reason}'}"
            for one in known[:_MAX_NAMED]]
    return "; ".join(whys)


def names_of(sensors: Iterable[SensorPeer]) -> str:
    """Give the names of some sensors, for whoever asked for another one."""
    names = sorted({one.name for one in sensors})
    more = ", ..." if len(names) > _MAX_NAMED else ""
    return ", ".join(names[:_MAX_NAMED]) + more or "none"
