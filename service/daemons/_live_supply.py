"""Frames of a live sensor for the capture process: the first that is newer than the press."""

import math
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace

from denseface.capture import RgbdFrame
from denseface.capture.burst import fuse
from denseface.capture.errors import FrameError, MismatchedFrameError
from denseface.capture.live.sensor import LiveSensor, Shot
from denseface.capture.live.states import LiveState
from denseface.service.daemons._supply import NotTaken, Outcome, Picture, Supply, SupplyState, Taken
from denseface.service.gate.live import Hinted, LiveGate, NotPassed, Passed
from denseface.service.protocol import messages
from denseface.service.protocol.sensor_messages import SensorFigures
from denseface.service.runtime.wake_pipe import WakePipe

_HOPEFUL = (LiveState.OPENING, LiveState.WARMING, LiveState.STREAMING, LiveState.STALLED)
"""States in which a press waits: there will be frames soon, or it will be known that not."""
_HOLD_S = 0.05
"""Age up to which a picture waits for its hint, seconds: half of the three frame periods that a
mirror may lag. On a machine with time to spare that is long enough."""
_LATE_S = 2.0
"""A hint of a frame so much older than the picture says nothing of it any more, seconds. One that
is younger goes with it: on a slow machine none would ever be as early as its own picture."""
_LOOKED_AT_S = 1.0
"""After the last preview frames are judged for so long, seconds."""


@dataclass
class _Press:
    capture_id: str
    at_s: float
    """When it came, monotonic clock."""
    wanted: int
    """Frames."""
    shots: list[Shot] = field(default_factory=list)
    """Those it has."""
    gate_s: float = 0.0
    """How long its gate may wait for a good one."""
    gated: bool = False
    """Whether the gate chooses its first frame."""
    fusing: Future[RgbdFrame] | None = None
    """Its burst, when it has all shots."""

    @property
    def next_s(self) -> float:
        """When its next frame is exposed at the earliest."""
        return math.nextafter(self.shots[-1].earliest_s, math.inf) if self.shots else self.at_s


class LiveSupply(Supply):
    """Each press gets the first pair of which both images were surely exposed after it came.

    Parameters
    ----------
    patience_s : how long a press waits while the sensor is opened or has none
    """

    def __init__(self, sensor: LiveSensor, patience_s: float) -> None:
        self.wake = WakePipe()
        self._sensor = sensor
        self._patience_s = patience_s
        self._presses: dict[str, _Press] = {}
        self._preview_due = False
        self._shown_s = 0.0
        """`latest_s` of the pair that the last preview showed."""
        self._hinted_s = 0.0
        """The same of the pair whose hint was given last with one."""
        self._gate = LiveGate(sensor, self.wake.wake)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="burst")
        sensor.on_change = self.wake.wake

    @property
    def state(self) -> SupplyState:
        sensor, figures = self._sensor, self._sensor.figures
        return SupplyState(sensor.state.value, sensor.reason[:500], sensor.identity[:200],
                           SensorFigures(
                               frames=figures.frames, drops=figures.drops,
                               skew_us=abs(figures.skew_us), stalls=figures.stalls,
                               reconnects=figures.reconnects, wrong_size=figures.wrong_size))

    def press(self, take: messages.Take) -> None:
        if take.capture_id in self._presses:
            return
        press = _Press(take.capture_id, time.monotonic(), take.frames)
        if take.gate != "off":
            press.gated, press.gate_s = True, take.gate_timeout
            self._gate.press(take)
        self._presses[take.capture_id] = press

    def preview(self) -> None:
        self._preview_due = True
        self._gate.look(_LOOKED_AT_S)

    def send_hints(self, seconds: float) -> None:
        self._gate.send_hints(seconds)

    def step(self, *, busy: bool) -> Iterator[Outcome]:
        for judged in self._gate.step():
            match judged:
                case Hinted():
                    yield judged
                case Passed(capture_id, good):
                    self._presses[capture_id].shots.append(self._looked_at(good))
                case NotPassed(capture_id, last):
                    del self._presses[capture_id]
                    yield NotTaken(capture_id, last.refusal, last.hint)
        for press in [*self._presses.values()]:
            outcome = self._serve(press)
            if outcome is not None:
                del self._presses[press.capture_id]
                self._gate.withdraw(press.capture_id)
                yield outcome
        self._sensor.lock_exposure(on=any(
            len(one.shots) < one.wanted > 1 for one in self._presses.values()))
        if self._preview_due and not busy:
            yield from self._picture()

    def _picture(self) -> Iterator[Picture]:
        """Give a picture that is newer than the last: the one with a hint of its own, if any.

        The newest hint that none had goes with it also where it tells of one shown before.
        """
        judged, hint = self._gate.last_hint() or (None, None)
        shot = judged
        if shot is None or shot.latest_s <= self._shown_s:
            shot = self._sensor.latest()  # asked, it tells of the next one
            judging = self._gate.judging
            if (judging is not None and judging.latest_s > self._shown_s
                    and time.monotonic() - judging.latest_s < _HOLD_S):
                return
        if shot is None or shot.latest_s <= self._shown_s:
            return
        self._preview_due, self._shown_s = False, shot.latest_s
        oldest_s = max(self._hinted_s, shot.latest_s - _LATE_S)
        if judged is not None and judged.latest_s > oldest_s:
            self._hinted_s = judged.latest_s
        else:
            hint = None
        yield Picture(shot.frame, hint)

    def _serve(self, press: _Press) -> Outcome | None:
        while len(press.shots) < press.wanted:
            # The state first: a pair that comes in between is not overlooked.
            state, reason = self._sensor.state, self._sensor.reason
            left_to_gate = press.gated and not press.shots
            try:
                shot = None if left_to_gate else self._sensor.first_after(
                    press.next_s, closely=not press.shots)
            except MismatchedFrameError as error:
                return NotTaken(press.capture_id, str(error))
            if shot is not None:
                press.shots.append(shot)
                continue
            if state not in _HOPEFUL:
                return NotTaken(press.capture_id, reason)
            waited_s = time.monotonic() - press.at_s
            if waited_s > self._patience_s + press.gate_s:
                return NotTaken(press.capture_id, (
                    f"no frame within {waited_s:.1f} s: " + (reason or "none is new enough")))
            return None
        return self._finish(press)

    def _finish(self, press: _Press) -> Outcome | None:
        """Give the frame of a press that has its shots; several are fused in a thread."""
        if press.wanted == 1:
            return Taken(press.capture_id, _pressed(press))
        if press.fusing is None:
            press.fusing = self._pool.submit(_pressed, press)
            press.fusing.add_done_callback(lambda _: self.wake.wake())
        if not press.fusing.done():
            return None
        try:
            return Taken(press.capture_id, press.fusing.result())
        except FrameError as error:
            return NotTaken(press.capture_id, str(error))

    def _looked_at(self, judged: Shot) -> Shot:
        """Give the same pair with what is found at a closer look, as long as the sensor has it."""
        again = self._sensor.first_after(judged.earliest_s)
        return again if again is not None and again.earliest_s == judged.earliest_s else judged

    def hangs(self) -> str:
        return self._sensor.needs_new_process()

    def close(self) -> bool:
        self._gate.close()
        self._pool.shutdown()
        return self._sensor.close()


def _pressed(press: _Press) -> RgbdFrame:
    """Make the frame of a press of its shots, with how much later the first was exposed."""
    frame = fuse([shot.frame for shot in press.shots])
    missed = press.shots[-1].number - press.shots[0].number + 1 - len(press.shots)
    if missed:
        frame = frame.with_note(f"{missed} frames between those of the burst were lost")
    after_ms = round((press.shots[0].earliest_s - press.at_s) * 1e3, 3)
    return replace(frame, origin=replace(frame.origin, exposed_after_press_ms=after_ms))
