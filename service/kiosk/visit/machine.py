"""A kiosk: at most one visit at a time; events and the time in, effects and a screen out."""

import math
from collections.abc import Callable
from typing import Any

from denseface.service.kiosk.page_messages import CountdownScreen, FromPage, Screen, ScreenName
from denseface.service.kiosk.visit._state import State
from denseface.service.kiosk.visit._transitions import ALWAYS, TRANSITIONS
from denseface.service.kiosk.visit.effects import Effect
from denseface.service.kiosk.visit.events import (
    CaptureRefused,
    Event,
    FaceCame,
    FaceFailed,
    FrameTaken,
    ServiceIs,
    Withdrawn,
)
from denseface.service.kiosk.visit.hint_statistics import HintStatistics
from denseface.service.kiosk.visit.options import VisitOptions
from denseface.service.kiosk.visit.timers import Timer

__all__ = ["Kiosk"]

_OF_CAPTURE = (FrameTaken, CaptureRefused, FaceCame, FaceFailed)
"""Answers that are of use to whoever waits for that very capture."""


class Kiosk:
    """Nothing waits here, and nothing raises: what does not fit is left out.

    Until the first `ServiceIs` the hub counts as gone. All times are of one clock that only goes
    forward, in seconds.

    Parameters
    ----------
    options : what the operator has set
    new_id : makes the id of a capture, one that cannot be guessed
    utc : the time of day, ISO 8601
    """

    def __init__(
        self, options: VisitOptions, *, new_id: Callable[[], str], utc: Callable[[], str]
    ) -> None:
        self._state = State(options, new_id, utc)
        self._now_s = -math.inf
        """Of the last call."""

    @property
    def visit(self) -> int:
        """The number of the visit; on the first screen that of the next."""
        return self._state.visit.number

    @property
    def busy(self) -> bool:
        """Whether there is a visit: other pages than its own show so."""
        return self._state.name is not ScreenName.ATTRACT

    @property
    def hint_statistics(self) -> HintStatistics:
        """Why people wait, and what becomes of visits."""
        return self._state.statistics

    def page(self, said: FromPage, now_s: float) -> list[Effect]:
        """Take what the page of the visit says; of another visit it changes nothing."""
        self._now_s = now_s
        if said.visit == self.visit:
            if said.kind not in {"next", "drawn"}:
                self._state.touch(now_s)
            self._step(type(said), said, now_s)
        return self._effects()

    def happened(self, event: Event, now_s: float) -> list[Effect]:
        """Take what else happens; of another visit, or of a capture given up, it changes nothing.

        An answer about a capture that was withdrawn has it withdrawn once more: the answer may
        have been given before there was anything to withdraw.
        """
        self._now_s = now_s
        state = self._state
        match event:
            case FrameTaken() | CaptureRefused() | FaceCame() | FaceFailed():
                if event.visit == self.visit and event.capture_id == state.visit.capture_id:
                    self._step(type(event), event, now_s)
                elif not isinstance(event, CaptureRefused):
                    again = state.withdrawals.came_late(event.capture_id, now_s)
                    state.effects += [again] if again is not None else []
            case Withdrawn():
                if state.withdrawals.answered(event.capture_id):
                    self._step(Withdrawn, event, now_s)
            case ServiceIs():
                self._service_is(event, now_s)
            case _:
                if getattr(event, "visit", None) in {None, self.visit}:
                    self._step(type(event), event, now_s)
        return self._effects()

    def tick(self, now_s: float) -> list[Effect]:
        """Let happen what is due by now; called at `next_at_s`."""
        self._now_s = now_s
        state = self._state
        while (due := state.timers.pop(now_s)) is not None:
            if due.visit == self.visit:
                self._step(due.timer, due.timer, now_s)
        state.effects += state.withdrawals.due(now_s)
        return self._effects()

    @property
    def next_at_s(self) -> float | None:
        """When `tick` is due, or the screen changes by itself; None where only others act."""
        state = self._state
        times = [state.timers.next_s, state.withdrawals.next_s, self._next_leaving_s()]
        if state.name is ScreenName.POSITION and state.guidance.slow_from_s > self._now_s:
            times.append(state.guidance.slow_from_s)
        return min((at_s for at_s in times if at_s is not None), default=None)

    def screen(self, now_s: float) -> Screen:
        """Give what the page of the visit shows now."""
        state, visit, name = self._state, self._state.visit, self._state.name
        left_s = state.leaving_s(now_s)
        searching = name is ScreenName.POSITION
        with_face = name in {ScreenName.RESULT, ScreenName.KEEP}
        return Screen(
            visit=visit.number, name=name, trouble=state.trouble,
            leaving_s=math.ceil(round(left_s, 3)) if left_s is not None else None,
            consent=visit.consent if name is ScreenName.CONSENT else None,
            position=state.guidance.screen(now_s) if searching else None,
            countdown=(CountdownScreen(left=visit.left)
                       if name is ScreenName.COUNTDOWN else None),
            result=visit.result if with_face else None,
            keep=visit.keep if name is ScreenName.KEEP else None,
            failed=visit.failed if name is ScreenName.FAILED else None,
            thanks=visit.thanks if name is ScreenName.THANKS else None)

    def busy_screen(self) -> Screen:
        """Give what a page shows while another one has the visit."""
        return Screen(visit=self.visit, name=ScreenName.BUSY, trouble=self._state.trouble)

    def _service_is(self, event: ServiceIs, now_s: float) -> None:
        state = self._state
        if event.trouble is None and state.trouble is not None:
            state.withdrawals.hurry(now_s)
        before = state.trouble, state.retention_s
        if (event.trouble, event.retention_s) != before:
            if event.trouble is None:
                state.retention_s = event.retention_s
            self._step(ServiceIs, event, now_s)
            state.trouble = event.trouble

    def _step(self, key: type | Timer, happened: Any, now_s: float) -> None:
        state = self._state
        step = TRANSITIONS.get((state.name, key))
        if step is None and self.busy:
            step = ALWAYS.get(key)
        if step is not None:
            step(state, happened, now_s)

    def _next_leaving_s(self) -> float | None:
        """Say when the next whole second of "still there?" is shown."""
        at_s = self._state.timers.at_s(Timer.IDLE)
        if at_s is None:
            return None
        whole = math.ceil(self._state.options.leaving_s)
        return min((at_s - left for left in range(whole + 1) if at_s - left > self._now_s),
                   default=at_s)

    def _effects(self) -> list[Effect]:
        effects, self._state.effects = self._state.effects, []
        return effects
