"""All that can happen to a visit, as one table; what is not in it changes nothing.

Before a transition it is made sure that what happens is of this visit and of the capture that it
waits for.
"""

from collections.abc import Callable
from typing import Any

from denseface.service.kiosk.page_messages import (
    Again,
    Begin,
    Cancel,
    Consent,
    ConsentScreen,
    Delete,
    Done,
    Drawn,
    FailedScreen,
    Keep,
    Press,
    ScreenName,
    Trouble,
)
from denseface.service.kiosk.visit._state import State, Visit
from denseface.service.kiosk.visit.effects import Consented, MakeLinks
from denseface.service.kiosk.visit.events import (
    CaptureRefused,
    FaceCame,
    FaceFailed,
    FrameTaken,
    HintCame,
    LinksFailed,
    LinksMade,
    PageWent,
    ServiceIs,
    Withdrawn,
)
from denseface.service.kiosk.visit.guidance import has_face
from denseface.service.kiosk.visit.hint_statistics import VisitEnd
from denseface.service.kiosk.visit.timers import Timer

__all__ = ["ALWAYS", "TRANSITIONS", "Step"]

Step = Callable[[State, Any, float], None]
"""State, what happened, and the time."""

_WHY = {
    "no_sensor": "sensor", "sensor": "sensor", "sensor_gone": "sensor", "timeout": "sensor",
    "quality": "quality", "queue": "busy", "disk": "busy", "NoFaceError": "no_face",
}
"""By the hub's reason or error: what the page has words for. All else is `failed`."""


def _begin(state: State, said: Any, now_s: float) -> None:  # noqa: ARG001
    """Begin a visit, unless something is missing: the first screen says what."""
    if state.trouble is not None:
        return
    state.statistics.visits += 1
    state.visit.touched_s = now_s
    if state.options.consent:
        _ask(state, now_s)
    else:
        state.visit.agreed = True
        state.search_anew(now_s)


def _ask(state: State, now_s: float) -> None:
    options = state.options
    state.visit.consent = ConsentScreen(
        retention_s=state.retention_s, text_version=options.text_version, text=options.text,
        links=options.links)
    state.go(ScreenName.CONSENT, now_s)


def _ask_anew(state: State, happened: ServiceIs, now_s: float) -> None:
    """Ask under a new number where what is shown is no longer so: a "yes" to it counts no more."""
    shown = state.visit.consent
    if happened.trouble is None and shown is not None and (
            shown.retention_s != happened.retention_s):
        state.visit = Visit(state.visit.number + 1, touched_s=state.visit.touched_s)
        _ask(state, now_s)


def _answer(state: State, said: Consent, now_s: float) -> None:
    shown = state.visit.consent
    if not said.agreed or shown is None:
        state.thank(now_s, VisitEnd.DECLINED, deleted=None)
        return
    state.visit.agreed = True
    state.visit.consented = Consented(
        shown.text_version, said.language, shown.retention_s, state.utc())
    state.search_anew(now_s)


def _look(state: State, happened: HintCame, now_s: float) -> None:
    """Take a sample, and the picture where the visitor stands well."""
    if state.trouble is not None:
        return
    hint = happened.hint
    state.statistics.sample(hint.codes[0] if hint.codes else None, now_s)
    state.guidance.hint(hint, now_s)
    if has_face(hint):
        state.restart_idle(now_s)
    # Whoever is asked whether they are there has to answer first: a poster on the wall does not.
    if state.options.auto and state.guidance.settled and state.leaving_s(now_s) is None:
        state.count_down(now_s, anyhow=False)


def _press(state: State, said: Press, now_s: float) -> None:  # noqa: ARG001
    if state.trouble is None and state.guidance.can_press(now_s):
        state.count_down(now_s, anyhow=state.guidance.warns(now_s))


def _watch(state: State, happened: HintCame, now_s: float) -> None:
    """Go back where nobody is there any more while it counts."""
    state.guidance.hint(happened.hint, now_s)
    gone = state.guidance.nobody if state.visit.anyhow else True
    if state.visit.capture_id is None and gone and state.guidance.lost(now_s):
        state.search(now_s)


def _count(state: State, due: Timer, now_s: float) -> None:  # noqa: ARG001
    state.visit.left -= 1
    state.count(now_s)


def _interrupt(state: State, happened: ServiceIs, now_s: float) -> None:
    """Go back where there can be no picture; one that is being taken may still come."""
    taking = state.visit.capture_id is not None
    if happened.trouble is None or (taking and happened.trouble is Trouble.WORKER):
        return
    state.drop_capture(now_s)
    state.search(now_s)


def _serve(state: State, happened: ServiceIs, now_s: float) -> None:
    """Let the search go on by itself when what was missing is back."""
    if (happened.trouble is None) != (state.trouble is None):
        state.guidance.begin_again(now_s)
        state.statistics.stop()


def _taken(state: State, happened: FrameTaken, now_s: float) -> None:  # noqa: ARG001
    state.go(ScreenName.CAPTURED, now_s)
    state.timers.start(state.visit.number, Timer.SHOWN, now_s + state.options.feedback_s)


def _wait(state: State, due: Timer, now_s: float) -> None:  # noqa: ARG001
    state.go(ScreenName.RECONSTRUCTING, now_s)


def _show(state: State, happened: FaceCame, now_s: float) -> None:
    visit = state.visit
    result = happened.result
    if visit.anyhow and not result.warnings:
        result = result.model_copy(update={"warnings": state.guidance.codes})
    visit.captures.append(happened.capture_id)
    visit.capture_id, visit.result, visit.keep = None, result, None
    visit.drawn = visit.linking = False
    visit.touched_s = now_s
    state.statistics.faces += 1
    state.go(ScreenName.RESULT, now_s)


def _refused(state: State, happened: CaptureRefused, now_s: float) -> None:
    """Say why; there is nothing to withdraw."""
    why = _WHY.get(happened.reason, "failed")
    code = happened.hint.codes[0] if happened.hint is not None and happened.hint.codes else None
    state.fail(why, now_s, FailedScreen(why=why, hint=code))


def _failed(state: State, happened: FaceFailed, now_s: float) -> None:
    """Say why, and keep no picture of which nobody has anything."""
    state.drop_capture(now_s)
    state.fail(_WHY.get(happened.error, "failed"), now_s)


def _give_up(state: State, due: Timer, now_s: float) -> None:  # noqa: ARG001
    state.drop_capture(now_s)
    state.fail("failed", now_s)


def _go_on(state: State, due: Timer, now_s: float) -> None:  # noqa: ARG001
    state.visit.failed = None
    state.search(now_s)


def _drawn(state: State, said: Drawn, now_s: float) -> None:
    if state.visit.result is not None and said.capture_id == state.visit.result.capture_id:
        state.visit.drawn = True
        state.restart_idle(now_s)


def _again(state: State, said: Again, now_s: float) -> None:  # noqa: ARG001
    """Take another; the former face is kept for its time, or goes with "delete now"."""
    state.visit.result = state.visit.keep = None
    state.search_anew(now_s)


def _keep(state: State, said: Keep, now_s: float) -> None:  # noqa: ARG001
    result = state.visit.result
    if result is not None and result.can_keep and not state.visit.linking:
        state.visit.linking = True
        state.visit.result = result.model_copy(update={"no_links": False})
        state.effects.append(MakeLinks(state.visit.number, result.capture_id))


def _linked(state: State, happened: LinksMade, now_s: float) -> None:
    result = state.visit.result
    if result is not None and happened.capture_id == result.capture_id:
        state.visit.keep, state.visit.linking = happened.keep, False
        state.statistics.kept += 1
        state.go(ScreenName.KEEP, now_s)


def _unlinked(state: State, happened: LinksFailed, now_s: float) -> None:  # noqa: ARG001
    """Say so; the button may be pressed again."""
    result = state.visit.result
    if result is not None and happened.capture_id == result.capture_id:
        state.visit.linking = False
        state.visit.result = result.model_copy(update={"no_links": True})


def _delete(state: State, said: Delete, now_s: float) -> None:  # noqa: ARG001
    """Withdraw all that this visit has; it is said when the hub has answered."""
    for capture_id in state.visit.captures:
        state.withdraw(capture_id, now_s)
    state.visit.result = state.visit.keep = None
    state.go(ScreenName.DELETING, now_s)


def _removed(state: State, happened: Withdrawn, now_s: float) -> None:  # noqa: ARG001
    if not state.withdrawals.pending(state.visit.captures):
        state.thank(now_s, VisitEnd.DELETED, deleted=True)


def _done(state: State, said: Done | Cancel, now_s: float) -> None:  # noqa: ARG001
    state.thank(now_s, VisitEnd.DONE, deleted=False)


def _finish(state: State, happened: Any, now_s: float) -> None:  # noqa: ARG001
    state.end(now_s, None)


def _cancel(state: State, said: Cancel, now_s: float) -> None:  # noqa: ARG001
    state.end(now_s, VisitEnd.CANCELLED)


def _leave(state: State, due: Timer, now_s: float) -> None:  # noqa: ARG001
    state.end(now_s, VisitEnd.LEFT)


def _page_gone(state: State, happened: PageWent, now_s: float) -> None:  # noqa: ARG001
    """End the visit; a result that was not seen is withdrawn like a picture on its way."""
    if state.visit.result is not None and not state.visit.drawn:
        state.withdraw(state.visit.result.capture_id, now_s)
    state.end(now_s, VisitEnd.PAGE_GONE)


_S = ScreenName
TRANSITIONS: dict[tuple[ScreenName, type | Timer], Step] = {
    (_S.ATTRACT, Begin): _begin,
    (_S.ATTRACT, Press): _begin,

    (_S.CONSENT, Consent): _answer,
    (_S.CONSENT, ServiceIs): _ask_anew,

    (_S.POSITION, HintCame): _look,
    (_S.POSITION, Press): _press,
    (_S.POSITION, ServiceIs): _serve,

    (_S.COUNTDOWN, Timer.COUNT): _count,
    (_S.COUNTDOWN, HintCame): _watch,
    (_S.COUNTDOWN, ServiceIs): _interrupt,
    (_S.COUNTDOWN, FrameTaken): _taken,
    (_S.COUNTDOWN, Timer.ANSWER): _give_up,

    (_S.CAPTURED, Timer.SHOWN): _wait,

    (_S.RESULT, Drawn): _drawn,
    (_S.RESULT, Keep): _keep,
    (_S.RESULT, LinksMade): _linked,
    (_S.RESULT, LinksFailed): _unlinked,

    (_S.DELETING, Withdrawn): _removed,

    (_S.FAILED, Timer.SHOWN): _go_on,

    (_S.THANKS, Timer.SHOWN): _finish,
    (_S.THANKS, Press): _finish,
    (_S.THANKS, Done): _finish,
    (_S.THANKS, Cancel): _finish,
}
"""By the screen and what happens there."""

_AWAITED: dict[type, Step] = {
    FaceCame: _show, FaceFailed: _failed, CaptureRefused: _refused,
}
# A face may come with its frame, and a press that is repeated to a new hub may be refused.
for _screen in (_S.COUNTDOWN, _S.CAPTURED, _S.RECONSTRUCTING):
    TRANSITIONS |= {(_screen, _happened): _step for _happened, _step in _AWAITED.items()}

_WITH_FACE: dict[type, Step] = {Again: _again, Delete: _delete, Done: _done, Cancel: _done}
for _screen in (_S.RESULT, _S.KEEP):
    TRANSITIONS |= {(_screen, _said): _step for _said, _step in _WITH_FACE.items()}

ALWAYS: dict[type | Timer, Step] = {
    Cancel: _cancel,
    PageWent: _page_gone,
    Timer.IDLE: _leave,
}
"""On every screen but the first, where the table above says nothing else."""
