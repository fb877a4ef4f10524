"""A kiosk that a test drives: its clock, its hub's answers, and what it asked for."""

from itertools import count

from denseface.service.kiosk import page_messages as page
from denseface.service.kiosk.visit import events
from denseface.service.kiosk.visit.effects import MakeLinks, Mirror, TakePicture, Withdraw
from denseface.service.kiosk.visit.machine import Kiosk
from denseface.service.kiosk.visit.options import VisitOptions
from denseface.service.protocol.hint import Hint

DAY_S = 86400.0
KEEP = page.KeepScreen(page="https://192.0.2.7:8443/d/x", qr=("1",), uses=5, expires_s=1800.0)


def hint(*codes, face=True):
    return Hint(timestamp_us=1, codes=codes, measures={"distance_mm": 750.0} if face else {})


GOOD = hint()
NOBODY = hint("nobody", face=False)


class Driven:
    """Keeps what was asked for; says and answers under the present visit's number."""

    def __init__(self, *, retention_s=DAY_S, **options):
        ids = count(1)
        self.kiosk = Kiosk(VisitOptions(**options), new_id=lambda: f"c{next(ids)}",
                           utc=lambda: "2026-11-29T12:00:00+00:00")
        self.now_s = 100.0
        self.asked = []
        self.check = lambda _: None
        """Called with each effect when it is given out."""
        self.service(None, retention_s)

    # --- what is shown

    @property
    def screen(self):
        return self.kiosk.screen(self.now_s)

    @property
    def name(self):
        return self.screen.name.value

    def of(self, kind):
        return [one for one in self.asked if isinstance(one, kind)]

    @property
    def pictures(self):
        return [one.capture_id for one in self.of(TakePicture)]

    @property
    def withdrawn(self):
        return [one.capture_id for one in self.of(Withdraw)]

    @property
    def linked(self):
        return [one.capture_id for one in self.of(MakeLinks)]

    @property
    def mirror(self):
        said = self.of(Mirror)
        return bool(said) and said[-1].on

    # --- what happens

    def say(self, kind, visit=None, **fields):
        return self._take(self.kiosk.page(
            kind(visit=visit or self.kiosk.visit, **fields), self.now_s))

    def happen(self, event):
        return self._take(self.kiosk.happened(event, self.now_s))

    def service(self, trouble, retention_s=DAY_S):
        return self.happen(events.ServiceIs(trouble, retention_s))

    def hints(self, *hints, period_s=0.1):
        for one in hints:
            self.wait(period_s)
            self.happen(events.HintCame(one))

    def wait(self, seconds):
        """Let time go by, with a tick whenever one is due."""
        until_s = self.now_s + seconds
        while (at_s := self.kiosk.next_at_s) is not None and at_s <= until_s:
            self.now_s = max(self.now_s, at_s)
            self._take(self.kiosk.tick(self.now_s))
        self.now_s = until_s

    def answer(self, kind, *fields, visit=None, capture_id=None):
        """Answer for the picture that was asked for last."""
        last = self.of(TakePicture)[-1]
        return self.happen(kind(visit or last.visit, capture_id or last.capture_id, *fields))

    def face(self, *, can_keep=True, **of):
        last = of.get("capture_id") or self.pictures[-1]
        return self.answer(events.FaceCame, page.ResultScreen(
            capture_id=last, can_keep=can_keep), **of)

    def _take(self, effects):
        for effect in effects:
            self.asked.append(effect)
            self.check(effect)
        return effects

    # --- to where a test begins

    def to(self, name):
        """Go on to a screen, by the shortest way."""
        getattr(self, f"_to_{name}")()
        assert self.name == name
        return self

    def _to_attract(self):
        pass

    def _to_consent(self):
        self.say(page.Begin)

    def _to_position(self):
        self.to("consent").say(page.Consent, agreed=True, language="en")

    def _to_countdown(self):
        self.to("position").hints(*[GOOD] * 5)

    def _to_taking(self):
        self.to("countdown").wait(3.0)

    def _to_captured(self):
        self._to_taking()
        self.answer(events.FrameTaken)

    def _to_reconstructing(self):
        self.to("captured").wait(0.5)

    def _to_result(self):
        self.to("reconstructing").face()

    def _to_keep(self):
        self.to("result").say(page.Keep)
        self.answer(events.LinksMade, KEEP)

    def _to_deleting(self):
        self.to("result").say(page.Delete)

    def _to_failed(self):
        self.to("reconstructing").answer(events.FaceFailed, "NoFaceError")

    def _to_thanks(self):
        self.to("result").say(page.Done)
