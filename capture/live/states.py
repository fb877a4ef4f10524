"""The states of a live sensor, as a table: what happens in each, and how long each may take.

::

    ABSENT ---> OPENING ---> WARMING ---> STREAMING <---> STALLED
      ^  ^       |   |       ^  |             |              |
      |  |       |   +-------|--+-- CLOSING <-+--------------+
      |  |       v           |         |
      |  +--- BLOCKED -------+         |
      +--------------------------------+

A sensor is never given up. What ends when the driver hangs is the process, not the waiting.
"""

import math
from collections import deque
from dataclasses import dataclass, field, fields
from enum import Enum

__all__ = ["LiveEvent", "LiveFigures", "LiveState", "LiveStates"]


class LiveState(Enum):
    """Where a live sensor is."""

    ABSENT = "absent"
    """The driver lists no such sensor."""
    OPENING = "opening"
    WARMING = "warming"
    """It sends; the frames are not yet as they will be: clocks unknown, exposure settling."""
    STREAMING = "streaming"
    STALLED = "stalled"
    """It has fallen silent, or sends the same frame again and again."""
    BLOCKED = "blocked"
    """It is there and cannot be had: no permission, busy, no library, no mode."""
    CLOSING = "closing"


class LiveEvent(Enum):
    """What moves a live sensor from one state to another."""

    FOUND = "found"
    """It is listed."""
    OPENED = "opened"
    """Its streams run."""
    REFUSED = "refused"
    """The library, the device or a stream cannot be had."""
    WARM = "warm"
    """Enough good frames came."""
    SILENT = "silent"
    """No new pair for longer than a sensor that works needs."""
    FRAME = "frame"
    """A new pair, after a silence."""
    LOST = "lost"
    """Unplugged, failed, or silent for too long: what is open is to be closed."""
    CLOSED = "closed"


TRANSITIONS: dict[tuple[LiveState, LiveEvent], LiveState] = {
    (LiveState.ABSENT, LiveEvent.FOUND): LiveState.OPENING,
    (LiveState.ABSENT, LiveEvent.REFUSED): LiveState.BLOCKED,
    (LiveState.OPENING, LiveEvent.OPENED): LiveState.WARMING,
    (LiveState.OPENING, LiveEvent.REFUSED): LiveState.BLOCKED,
    (LiveState.OPENING, LiveEvent.LOST): LiveState.CLOSING,
    (LiveState.WARMING, LiveEvent.WARM): LiveState.STREAMING,
    (LiveState.WARMING, LiveEvent.LOST): LiveState.CLOSING,
    (LiveState.STREAMING, LiveEvent.SILENT): LiveState.STALLED,
    (LiveState.STREAMING, LiveEvent.LOST): LiveState.CLOSING,
    (LiveState.STALLED, LiveEvent.FRAME): LiveState.STREAMING,
    (LiveState.STALLED, LiveEvent.LOST): LiveState.CLOSING,
    (LiveState.BLOCKED, LiveEvent.OPENED): LiveState.WARMING,
    (LiveState.BLOCKED, LiveEvent.LOST): LiveState.ABSENT,
    (LiveState.BLOCKED, LiveEvent.REFUSED): LiveState.BLOCKED,
    (LiveState.CLOSING, LiveEvent.CLOSED): LiveState.ABSENT,
}
"""What each event makes of each state; an event that has no row here is a mistake of ours."""

HANG_S: dict[LiveState, float] = dict.fromkeys(LiveState, 5.0) | {
    LiveState.ABSENT: 10.0, LiveState.BLOCKED: 10.0, LiveState.OPENING: 10.0,
    LiveState.CLOSING: 2.0}
"""How long one step of the driver may take in each state, seconds; beyond, it hangs, and only a new
process helps. Where nothing is amiss, waiting for a frame takes 0.1 s at most and opening 0.25 s.
"""

PATIENCE_S: dict[LiveState, float] = {LiveState.WARMING: 4.0, LiveState.STALLED: 0.5}
"""States that wait for frames, and how long, seconds; beyond, the sensor is closed and opened
again. A PS1080 sends its first frame within 1 s of the start; two more seconds are the exposure's.
"""

_LOOP_S = 60.0
"""Time over which losses are counted, seconds."""
_LOOP_LOSSES = 3
"""Losses within `_LOOP_S` that are no accident but a cable, a port or too little power."""


@dataclass(frozen=True)
class LiveFigures:
    """What a live sensor did since this process looks after it, or since it was opened."""

    frames: int = 0
    """Pairs."""
    drops: int = 0
    """Frames of either stream that never came, were of a wrong size, or found no room."""
    wrong_size: int = 0
    """Of those, frames of another size than their mode's."""
    repeats: int = 0
    """Frames that the driver gave twice."""
    stalls: int = 0
    """Times that it fell silent."""
    reconnects: int = 0
    """Times that it was opened again."""
    clock_jumps: int = 0
    """Times that one of its clocks jumped or started over."""
    skew_us: int = 0
    """Of the last pair: how much later the depth was taken, microseconds."""

    def __add__(self, later: "LiveFigures") -> "LiveFigures":
        """Put together what was counted before and later."""
        sums = {field.name: getattr(self, field.name) + getattr(later, field.name)
                for field in fields(self)}
        return LiveFigures(**sums | {"skew_us": later.skew_us or self.skew_us})


@dataclass
class LiveStates:
    """Where a live sensor is, since when and why.

    Attributes
    ----------
    since_s : when the state was entered, monotonic clock, seconds
    reason : why it does not stream, in words for the person who pressed; empty where it does
    """

    since_s: float
    state: LiveState = LiveState.ABSENT
    reason: str = "the sensor was not looked for yet"
    _losses: deque[float] = field(default_factory=deque)

    def advance(self, event: LiveEvent, now_s: float, reason: str = "") -> LiveState:
        """Follow an event; `reason` says why, where the sensor does not stream.

        Raises
        ------
        ValueError
            The table has no such transition.
        """
        after = TRANSITIONS.get((self.state, event))
        if after is None:
            raise ValueError(f"{event.value} means nothing while {self.state.value}")
        if event is LiveEvent.LOST and after is LiveState.CLOSING:
            self._losses.append(now_s)
        if after is LiveState.STREAMING:
            self.reason = ""
        elif reason:
            self.reason = self._with_losses(reason, now_s)
        if after is not self.state:
            self.state, self.since_s = after, now_s
        return after

    def _with_losses(self, reason: str, now_s: float) -> str:
        while self._losses and self._losses[0] < now_s - _LOOP_S:
            self._losses.popleft()
        if len(self._losses) < _LOOP_LOSSES:
            return reason
        return (f"{reason} (lost {_LOOP_LOSSES} times and more within a minute: try another cable, "
                "port or power supply)")

    def explain(self, reason: str) -> None:
        """Say anew why the sensor does not stream, in the same state."""
        self.reason = reason

    def overdue(self, now_s: float) -> bool:
        """Say whether frames were waited for in vain for so long that it is to be opened again."""
        return now_s - self.since_s > PATIENCE_S.get(self.state, math.inf)
