"""Frames of a source that is read frame after frame, for the capture process; in a thread."""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import structlog

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.burst import fuse
from denseface.capture.errors import SensorError
from denseface.service.daemons._supply import (
    Hinted,
    NotTaken,
    Outcome,
    Picture,
    Supply,
    SupplyState,
    Taken,
)
from denseface.service.daemons.sensor import SensorReader
from denseface.service.gate.hinting import Judged
from denseface.service.gate.pressing import Decision, GatedPress
from denseface.service.protocol import messages
from denseface.service.runtime.background import Background

if TYPE_CHECKING:
    from denseface.service.gate.frame_judge import FrameJudge

_CLOSING_S = 3.0
"""Longest wait for the driver's last call when the process stops, seconds."""
_PACE_S = 1 / 30
"""Between two frames of a recording while a press waits for a good one, seconds."""
JudgedFrame = tuple[RgbdFrame, Judged | None]
"""A frame, and what the gate says of it where it was asked."""
_log = structlog.get_logger("capture")


@dataclass
class _Press:
    capture_id: str
    gate: GatedPress
    frames: int = 1
    """Of so many one is made, the first of which the gate judges."""
    waited: bool = False
    """Whether a frame was not good enough for it."""
    kept: RgbdFrame | None = None
    """The best so far, where it takes the best."""


class ReaderSupply(Supply):
    """Presses go before pictures; a press gets the frame that the last picture showed.

    Parameters
    ----------
    timeout_s : how long the driver may take for one frame
    """

    def __init__(
        self, reader: SensorReader, driver: Background[JudgedFrame | None], timeout_s: float
    ) -> None:
        self.wake = self._driver = driver
        self._reader = reader
        self._timeout_s = timeout_s
        self._open = False
        self._presses: deque[_Press] = deque()
        """Captures that wait for their frame, oldest first."""
        self._preview_due = self._hint_due = False
        self._peeking = False
        """Whether the driver's call is for a preview or a hint."""
        driver.start(reader.open)

    @property
    def state(self) -> SupplyState:
        return SupplyState("streaming") if self._open else SupplyState(
            "opening", "the source is being opened")

    def press(self, take: messages.Take) -> None:
        if all(press.capture_id != take.capture_id for press in self._presses):
            now = time.monotonic()
            self._presses.append(_Press(
                take.capture_id, GatedPress(take.gate, now, now + take.gate_timeout),
                take.frames))

    def preview(self) -> None:
        self._preview_due = True

    def send_hints(self, seconds: float) -> None:  # noqa: ARG002  it stands still until a press
        self._hint_due = True

    def step(self, *, busy: bool) -> Iterator[Outcome]:
        if self._driver.done():
            yield from self._finish_call()
        if self._driver:
            return
        if self._presses:
            self._driver.start(partial(self._take, self._presses[0]))
        elif (self._preview_due or self._hint_due) and not busy:
            self._peeking = True
            self._driver.start(self._peek)

    def _finish_call(self) -> Iterator[Outcome]:
        if not self._open:
            self._driver.result()
            self._open = True
            _log.info("source open", source=self._reader.uri)
            return
        peeking, self._peeking = self._peeking, False
        live = self._reader.live
        try:
            found = self._driver.result()
        except CaptureError as error:
            if peeking:
                self._preview_due = self._hint_due = False
                _log.warning("no preview", reason=str(error))
            else:
                yield NotTaken(self._presses.popleft().capture_id, str(error))
            if isinstance(error, SensorError):
                raise
            return
        if found is None:
            return
        frame, judged = found
        # A live sensor's frame that came after a press is the press's, for whatever it was taken.
        if self._presses and (not peeking or live):
            yield from self._decide(frame, judged)
        hint = judged.hint if judged is not None else None
        if self._preview_due and not self._presses and (peeking or live):
            self._preview_due = False
            yield Picture(frame, hint)
        if self._hint_due and hint is not None:
            self._hint_due = False
            yield Hinted(hint)

    def _decide(self, frame: RgbdFrame, judged: Judged | None) -> Iterator[Outcome]:
        """Give a frame to the press that is next, unless its gate does not let it through."""
        press = self._presses.popleft()
        decision = (Decision.TAKE if judged is None
                    else press.gate.decide(judged, time.monotonic()))
        if decision is Decision.TAKE:
            yield Taken(press.capture_id, frame)
        elif decision is Decision.TAKE_KEPT and press.kept is not None:
            yield Taken(press.capture_id, press.kept)
        elif judged is not None and decision is Decision.REFUSE:
            yield NotTaken(press.capture_id, judged.refusal, judged.hint)
        else:
            if decision is Decision.KEEP:
                press.kept = frame
            press.waited = True
            self._presses.append(press)

    def _take(self, press: _Press) -> JudgedFrame:
        """Read the next frame, in the driver's thread; at a sensor's pace while it waits."""
        if press.waited:
            time.sleep(_PACE_S)
        frame = self._reader.take()
        judged = None if press.gate.gate == "off" else self._judge.judge(frame)
        return fuse([frame, *(self._reader.take() for _ in range(press.frames - 1))]), judged

    def _peek(self) -> JudgedFrame:
        frame = self._reader.peek()
        return frame, self._judge.judge(frame)

    @cached_property
    def _judge(self) -> "FrameJudge":
        """What judges frames, in the driver's thread; a recording may never be asked for that."""
        from denseface.service.gate.frame_judge import FrameJudge  # loads all that finds faces

        return FrameJudge(time.monotonic)

    def hangs(self) -> str:
        seconds = self._driver.elapsed_s
        if seconds <= self._timeout_s or self._driver.done():
            return ""
        return f"{self._reader.uri}: no frame within {seconds:.0f} s"

    def close(self) -> bool:
        if not self._driver.wait(_CLOSING_S):
            return False
        with suppress(CaptureError):
            if self._driver:
                self._driver.result()
        self._driver.start(self._reader.close)
        return self._driver.wait(_CLOSING_S)
