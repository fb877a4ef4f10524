"""The gate of a live sensor: its frames are judged in a thread, some of them, while anybody asks.

The loop of the capture process decides which: about ten a second for hints and previews, each new
one while a press waits for a good one. The press gets the very frame that was judged.
"""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from denseface.capture.live.sensor import LiveSensor, Shot
from denseface.service.gate.hinting import Judged
from denseface.service.gate.pressing import Decision, GatedPress
from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint

__all__ = ["Hinted", "LiveGate", "NotPassed", "Passed"]

_PERIOD_S = 0.1
"""Between two frames that are judged for hints, seconds."""
_MOST_SHARE = 0.2
"""Of a core that hints may take: where a scene is costly to search, fewer frames are judged."""
_LONGEST_PERIOD_S = 0.5
"""The same where frames are costly, seconds: the first one's cost is that of loading kernels and
cascades, and says nothing of the next."""
_SLACK_S = 0.005
"""The third frame of thirty a second counts as after that, also where its time jitters."""
_WARM_S = 0.5
"""A gate that judged a frame so lately knows how a face moves; another needs so long, seconds."""


@dataclass(frozen=True)
class Passed:
    """A press gets this frame; whether its depth and colour belong together was not measured."""

    capture_id: str
    shot: Shot


@dataclass(frozen=True)
class NotPassed:
    """A press gets none: this was the last that was judged."""

    capture_id: str
    judged: Judged


@dataclass(frozen=True)
class Hinted:
    """What to tell the person now."""

    hint: Hint


@dataclass
class _Waiting:
    press: GatedPress
    next_s: float
    """Its next frame is exposed then at the earliest, monotonic clock."""
    kept: Shot | None = None
    """The best so far, where it takes the best."""


class LiveGate:
    """Judges frames of a sensor; nothing here waits.

    Parameters
    ----------
    sensor : whose frames
    wake : called in another thread when `step` has something to give
    clock : the sensor's
    cost_clock : processor time of the calling thread, seconds
    """

    def __init__(
        self, sensor: LiveSensor, wake: Callable[[], object],
        clock: Callable[[], float] = time.monotonic,
        cost_clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self._sensor = sensor
        self._wake = wake
        self._clock, self._cost_clock = clock, cost_clock
        # Loads all that finds faces, before the first press: only a sensor's gate needs it so soon.
        from denseface.service.gate.frame_judge import FrameJudge

        self._pool = ThreadPoolExecutor(1, thread_name_prefix="gate")
        self._judge = FrameJudge(clock)
        self._call: Future[Judged] | None = None
        self._shot: Shot | None = None
        """The one that is judged, or was judged last."""
        self._last: tuple[Shot, Hint] | None = None
        self._cost_s = 0.0
        """Processor time of the frame that was judged last."""
        self._hints_until_s = self._looked_until_s = 0.0
        self._waiting: dict[str, _Waiting] = {}

    def send_hints(self, seconds: float) -> None:
        """Give hints from now on, for so long."""
        self._hints_until_s = self._clock() + seconds

    def look(self, seconds: float) -> None:
        """Judge frames for so long, for the sake of `last_hint`."""
        self._looked_until_s = self._clock() + seconds

    def press(self, take: messages.Take) -> None:
        """Let a press wait for a frame that its gate lets through."""
        now = self._clock()
        warm = self._shot is not None and now - self._shot.latest_s < _WARM_S
        press = GatedPress(take.gate, now if warm else now + _WARM_S, now + take.gate_timeout)
        self._waiting[take.capture_id] = _Waiting(press, now)

    def withdraw(self, capture_id: str) -> None:
        """Forget a press, where it waits."""
        self._waiting.pop(capture_id, None)

    @property
    def judging(self) -> Shot | None:
        """The frame that is being judged."""
        return self._shot if self._call is not None else None

    def last_hint(self) -> tuple[Shot, Hint] | None:
        """Give the frame that was judged last, with its hint."""
        return self._last

    def step(self) -> Iterator[Passed | NotPassed | Hinted]:
        """Give what became of presses, and hints; begin to judge the next frame that is due."""
        if self._call is not None and self._call.done() and self._shot is not None:
            judged = self._call.result()
            self._call, self._last = None, (self._shot, judged.hint)
            yield from self._decide(self._shot, judged)
            if self._clock() < self._hints_until_s:
                yield Hinted(judged.hint)
        if self._call is None and (due_s := self._due_s()) is not None:
            shot = self._sensor.first_after(due_s, closely=False)
            if shot is not None:
                self._shot = shot
                self._call = self._pool.submit(self._judge_shot, shot)
                self._call.add_done_callback(lambda _: self._wake())

    def close(self) -> None:
        """Wait for the frame that is judged and end the thread."""
        self._pool.shutdown()

    def _due_s(self) -> float | None:
        """Say when the next frame to judge is exposed at the earliest; None for no frame."""
        if self._waiting:
            return min(waiting.next_s for waiting in self._waiting.values())
        now = self._clock()
        if now >= max(self._hints_until_s, self._looked_until_s):
            return None
        last_s = self._shot.earliest_s if self._shot is not None else -math.inf
        period_s = min(max(_PERIOD_S, self._cost_s / _MOST_SHARE), _LONGEST_PERIOD_S)
        return max(last_s + period_s - _SLACK_S, now - _PERIOD_S)

    def _decide(self, shot: Shot, judged: Judged) -> Iterator[Passed | NotPassed]:
        now = self._clock()
        for capture_id, waiting in [*self._waiting.items()]:
            if shot.earliest_s < waiting.next_s:
                continue  # judged for hints, and older than the press
            decision = waiting.press.decide(judged, now)
            if decision is Decision.KEEP:
                waiting.kept = shot
            if decision in {Decision.WAIT, Decision.KEEP}:
                waiting.next_s = math.nextafter(shot.earliest_s, math.inf)
                continue
            del self._waiting[capture_id]
            if decision is Decision.TAKE:
                yield Passed(capture_id, shot)
            elif decision is Decision.TAKE_KEPT and waiting.kept is not None:
                yield Passed(capture_id, waiting.kept)
            else:
                yield NotPassed(capture_id, judged)

    def _judge_shot(self, shot: Shot) -> Judged:
        """Judge a frame, in the thread."""
        begun_s = self._cost_clock()
        judged = self._judge.judge(shot.frame, round(shot.earliest_s * 1e6))
        self._cost_s = self._cost_clock() - begun_s
        return judged
