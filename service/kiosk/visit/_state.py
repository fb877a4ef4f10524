"""What a kiosk knows, and the moves that its transitions are made of."""

from collections.abc import Callable
from dataclasses import dataclass, field

from denseface.service.kiosk.page_messages import (
    ConsentScreen,
    FailedScreen,
    KeepScreen,
    ResultScreen,
    ScreenName,
    ThanksScreen,
    Trouble,
)
from denseface.service.kiosk.visit.effects import (
    Consented,
    Effect,
    Mirror,
    TakePicture,
)
from denseface.service.kiosk.visit.guidance import Guidance
from denseface.service.kiosk.visit.hint_statistics import HintStatistics, VisitEnd
from denseface.service.kiosk.visit.options import VisitOptions
from denseface.service.kiosk.visit.timers import Timer, Timers
from denseface.service.kiosk.visit.withdrawals import Withdrawals

__all__ = ["State", "Visit"]

_MIRROR_ON = (ScreenName.POSITION, ScreenName.COUNTDOWN)


@dataclass
class Visit:
    """What ends with a visit."""

    number: int
    consent: ConsentScreen | None = None
    """As shown."""
    agreed: bool = False
    """Pictures may be asked of the sensor."""
    consented: Consented | None = None
    """None where it is not asked."""
    captures: list[str] = field(default_factory=list)
    """Those whose faces were shown, and that are kept."""
    capture_id: str | None = None
    """The one whose outcome is awaited."""
    anyhow: bool = False
    """Whether any picture will do."""
    left: int = 0
    """Of the countdown."""
    searching_since_s: float = 0.0
    touched_s: float = 0.0
    drawn: bool = False
    """The result was seen."""
    linking: bool = False
    """Links are being made."""
    result: ResultScreen | None = None
    keep: KeepScreen | None = None
    failed: FailedScreen | None = None
    thanks: ThanksScreen | None = None


class State:
    """One kiosk; see `Kiosk` for the parameters."""

    def __init__(
        self, options: VisitOptions, new_id: Callable[[], str], utc: Callable[[], str]
    ) -> None:
        self.options = options
        self._new_id, self.utc = new_id, utc
        self.name = ScreenName.ATTRACT
        self.visit = Visit(1)
        self.trouble: Trouble | None = Trouble.HUB
        """Until it is known that all is well."""
        self.retention_s: float | None = None
        self.timers = Timers()
        self.withdrawals = Withdrawals()
        self.statistics = HintStatistics()
        self.guidance = Guidance(options, 0.0)
        self.effects: list[Effect] = []
        """Not yet given out."""
        self._mirror = False
        self._idle_s = {
            ScreenName.CONSENT: options.consent_s, ScreenName.RECONSTRUCTING: options.waiting_s,
            ScreenName.RESULT: options.result_s, ScreenName.KEEP: options.keep_s,
            ScreenName.DELETING: options.deleting_s,
        }

    def go(self, name: ScreenName, now_s: float) -> None:
        """Show another screen: only its own timers run from now on."""
        self.name = name
        self.timers.stop_all()
        self.restart_idle(now_s)
        mirror = name in _MIRROR_ON
        if mirror != self._mirror:
            self._mirror = mirror
            self.effects.append(Mirror(on=mirror))
        if not mirror:
            self.statistics.stop()

    def restart_idle(self, now_s: float) -> None:
        """Somebody is there: let the time begin anew after which the first screen comes."""
        idle_s = self._idle_s.get(self.name)
        if idle_s is not None:
            self.timers.start(self.visit.number, Timer.IDLE, now_s + idle_s)
        elif self.name is ScreenName.POSITION:
            longest_s = self.visit.touched_s + self.options.position_longest_s
            at_s = min(now_s + self.options.position_s, longest_s)
            self.timers.start(self.visit.number, Timer.IDLE,
                              max(at_s, self._leaving_began_s(now_s) + self.options.leaving_s))

    def _leaving_began_s(self, now_s: float) -> float:
        """Say since when it is asked whether somebody is there; now, where it is not yet."""
        left_s = self.leaving_s(now_s)
        return now_s if left_s is None else now_s + left_s - self.options.leaving_s

    def touch(self, now_s: float) -> None:
        """Note that the visitor did something."""
        self.visit.touched_s = now_s
        if self.timers.at_s(Timer.IDLE) is not None:
            self.restart_idle(now_s)

    def leaving_s(self, now_s: float) -> float | None:
        """Give the time left before the first screen comes, where it is little."""
        at_s = self.timers.at_s(Timer.IDLE)
        if at_s is None or at_s - now_s > self.options.leaving_s:
            return None
        return max(at_s - now_s, 0.0)

    def search(self, now_s: float) -> None:
        """Let the visitor look for their place; a search that was interrupted goes on."""
        self.guidance.forget()
        self.go(ScreenName.POSITION, now_s)

    def search_anew(self, now_s: float) -> None:
        """Let them look for it from the beginning."""
        self.guidance = Guidance(self.options, now_s)
        self.visit.searching_since_s = now_s
        self.go(ScreenName.POSITION, now_s)

    def count_down(self, now_s: float, *, anyhow: bool) -> None:
        """Begin the countdown, or take the picture where there is none."""
        self.visit.anyhow, self.visit.left = anyhow, self.options.countdown
        self.go(ScreenName.COUNTDOWN, now_s)
        self.count(now_s)

    def count(self, now_s: float) -> None:
        """Wait for the next number, or take the picture: once for each countdown."""
        visit = self.visit
        if visit.left > 0:
            self.timers.start(visit.number, Timer.COUNT, now_s + 1.0)
            return
        visit.capture_id = self._new_id()
        self.statistics.captures += 1
        self.statistics.positioning_s += now_s - visit.searching_since_s
        best_of_s = self.options.anyhow_best_of_s if visit.anyhow else self.options.best_of_s
        self.effects.append(TakePicture(
            visit.number, visit.capture_id, best_of_s, visit.consented))
        self.timers.start(visit.number, Timer.ANSWER, now_s + self.options.answer_s)

    def withdraw(self, capture_id: str, now_s: float) -> None:
        """Have a capture removed."""
        effect = self.withdrawals.ask(self.visit.number, capture_id, now_s)
        if effect is not None:
            self.effects.append(effect)

    def drop_capture(self, now_s: float) -> None:
        """Withdraw the capture whose outcome is awaited, if any: nobody waits any more."""
        if self.visit.capture_id is not None:
            self.withdraw(self.visit.capture_id, now_s)
            self.visit.capture_id = None

    def fail(self, why: str, now_s: float, failed: FailedScreen | None = None) -> None:
        """Say why there is no face."""
        self.statistics.failures[why] += 1
        self.visit.capture_id = None
        self.visit.failed = failed or FailedScreen(why=why)
        self.go(ScreenName.FAILED, now_s)
        self.timers.start(self.visit.number, Timer.SHOWN, now_s + self.options.failed_s)

    def thank(self, now_s: float, end: VisitEnd, *, deleted: bool | None) -> None:
        """Say goodbye, and what became of the captures."""
        self.statistics.ends[end] += 1
        retention_s = self.retention_s
        if self.visit.consent is not None:
            retention_s = self.visit.consent.retention_s
        self.visit.thanks = ThanksScreen(
            deleted=deleted, retention_s=None if deleted is not False else retention_s)
        self.go(ScreenName.THANKS, now_s)
        self.timers.start(self.visit.number, Timer.SHOWN, now_s + self.options.thanks_s)

    def end(self, now_s: float, end: VisitEnd | None) -> None:
        """End the visit: the first screen, under the number of the next."""
        if end is not None:
            self.statistics.ends[end] += 1
        self.drop_capture(now_s)
        self.visit = Visit(self.visit.number + 1)
        self.go(ScreenName.ATTRACT, now_s)
