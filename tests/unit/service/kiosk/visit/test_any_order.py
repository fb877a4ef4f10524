"""Whatever happens, in any order and however late, some things are always so."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from denseface.service.kiosk import page_messages as page
from denseface.service.kiosk.page_messages import ScreenName, Trouble
from denseface.service.kiosk.visit import events
from denseface.service.kiosk.visit.effects import MakeLinks, Mirror, TakePicture, Withdraw
from tests.unit.service.kiosk.visit.driving import GOOD, KEEP, NOBODY, Driven, hint

LONGEST_VISIT_S = 400.0
"""Without a touch: a search of 180 s and the screens after it."""
SAID = [page.Begin, page.Press, page.Next, page.Touch, page.Cancel, page.Again, page.Keep,
        page.Delete, page.Done]
HINTS = [GOOD, GOOD, GOOD, NOBODY, hint("move_back"), hint("hold_still", face=False)]
OPTIONS = st.fixed_dictionaries({}, optional={
    "consent": st.booleans(), "auto": st.booleans(), "countdown": st.integers(0, 3)})


class AnyOrder(RuleBasedStateMachine):
    """A page, a hub and a sensor that do what they want, some of it late or twice."""

    answers = Bundle("answers")

    def __init__(self):
        super().__init__()
        self.drive()
        self.agreed_in = set()
        self.asks_consent = True
        self.outcomes = {}
        """By capture, what the kiosk was told of it while its visit waited."""

    @rule(options=OPTIONS)
    @precondition(lambda self: not self.driven.asked and self.driven.kiosk.visit == 1)
    def begin_another_kiosk(self, options):
        self.drive(**options)
        self.asks_consent = options.get("consent", True)

    def drive(self, **options):
        self.driven = Driven(**options)
        self.driven.check = self.check

    @property
    def visit(self):
        return self.driven.kiosk.visit

    def happens(self, act, *, of_visit=None):
        """Do it; where it is of another visit it may have that one's captures removed, no more."""
        before, before_visit = self.driven.screen, self.visit
        effects = act() or []
        if of_visit is not None and of_visit != before_visit:
            assert self.driven.screen == before
            assert all(isinstance(one, Withdraw) for one in effects)

    def check(self, effect):
        match effect:
            case Mirror(on=True):
                assert self.visit in self.agreed_in or not self.asks_consent
            case TakePicture():
                assert effect.visit == self.visit
                assert effect.visit in self.agreed_in or not self.asks_consent
                assert (effect.consent is not None) == self.asks_consent
                assert self.driven.mirror
            case MakeLinks():
                assert effect.visit == self.visit

    # --- the page

    @rule(kind=st.sampled_from(SAID), late=st.sampled_from([0, 0, 0, 1, 2]))
    def say(self, kind, late):
        number = max(self.visit - late, 1)
        self.happens(lambda: self.driven.say(kind, visit=number), of_visit=number)

    @rule(agreed=st.booleans(), late=st.sampled_from([0, 0, 0, 1]))
    def consent(self, agreed, late):
        number = max(self.visit - late, 1)
        if agreed and number == self.visit and self.driven.name == "consent":
            self.agreed_in.add(number)
        self.happens(lambda: self.driven.say(
            page.Consent, visit=number, agreed=agreed, language="en"), of_visit=number)

    @rule(name=st.sampled_from(["position", "countdown", "taking", "captured", "reconstructing",
                                "result", "keep", "deleting", "failed", "thanks"]))
    @precondition(lambda self: self.driven.name == "attract")
    def come_far(self, name):
        """A visit that goes well until then."""
        driven = self.driven
        if not (self.asks_consent and driven.kiosk._state.options.auto):
            return
        driven.service(None)
        self.agreed_in.add(self.visit)
        getattr(driven, f"_to_{name}")()
        if name in {"result", "keep", "deleting", "thanks"}:
            self.outcomes[driven.pictures[-1]] = "shown"

    @rule()
    def draw(self):
        for capture_id in self.driven.pictures[-1:]:
            self.happens(lambda name=capture_id: self.driven.say(page.Drawn, capture_id=name))

    @rule(late=st.sampled_from([0, 0, 0, 1]))
    def page_went(self, late):
        number = max(self.visit - late, 1)
        self.happens(lambda: self.driven.happen(events.PageWent(number)), of_visit=number)

    # --- the service

    @rule(trouble=st.sampled_from([None, None, None, *Trouble]),
          retention_s=st.sampled_from([60.0, None, 86400.0]))
    def service(self, trouble, retention_s):
        self.happens(lambda: self.driven.service(trouble, retention_s))

    @rule(hints=st.lists(st.sampled_from(HINTS), max_size=6))
    def look(self, hints):
        for one in hints:
            self.wait(0.1)
            self.happens(lambda shown=one: self.driven.happen(events.HintCame(shown)))

    @rule()
    def stand_well(self):
        self.look([GOOD] * 6)

    @rule(target=answers, which=st.integers(0, 3), kind=st.sampled_from([
        events.FrameTaken, events.CaptureRefused, events.FaceCame, events.FaceFailed,
        events.LinksMade, events.LinksFailed]))
    def prepare_an_answer(self, which, kind):
        """Make an answer that may be given at once, later, twice, or never."""
        taken = self.driven.of(TakePicture)
        if not taken:
            return None
        asked = taken[-1 - which % len(taken)]
        fields = {
            events.FrameTaken: (), events.CaptureRefused: ("quality",),
            events.FaceCame: (page.ResultScreen(capture_id=asked.capture_id, can_keep=True),),
            events.FaceFailed: ("NoFaceError",), events.LinksMade: (KEEP,),
            events.LinksFailed: (),
        }[kind]
        return kind(asked.visit, asked.capture_id, *fields)

    @rule(answer=answers)
    def answer(self, answer):
        if answer is None:
            return
        if self.driven.kiosk._state.visit.capture_id == answer.capture_id:
            outcome = {events.FaceCame: "shown", events.CaptureRefused: "refused"}
            self.outcomes |= {answer.capture_id: outcome.get(type(answer))}
        self.happens(lambda: self.driven.happen(answer), of_visit=answer.visit)

    @rule(kind=st.sampled_from([events.FrameTaken, events.FaceCame]))
    def answer_at_once(self, kind):
        for asked in self.driven.of(TakePicture)[-1:]:
            more = ((page.ResultScreen(capture_id=asked.capture_id, can_keep=True),)
                    if kind is events.FaceCame else ())
            self.answer(kind(asked.visit, asked.capture_id, *more))

    @rule()
    def remove(self):
        for asked in self.driven.of(Withdraw)[-2:]:
            self.happens(lambda one=asked: self.driven.happen(
                events.Withdrawn(one.visit, one.capture_id)), of_visit=asked.visit)

    # --- time

    @rule(seconds=st.sampled_from([0.05, 0.5, 1.0, 3.0, 6.0, 25.0, 100.0]))
    def wait(self, seconds):
        self.driven.wait(seconds)

    # --- what is always so

    @invariant()
    def at_most_one_picture_is_awaited(self):
        open_ones = {}
        for effect in self.driven.asked:
            if isinstance(effect, TakePicture):
                open_ones.setdefault(effect.visit, []).append(effect.capture_id)
        assert len(self.driven.pictures) == len(set(self.driven.pictures))
        waiting = self.driven.kiosk._state.visit.capture_id
        assert waiting is None or waiting == open_ones[self.visit][-1]

    @invariant()
    def every_picture_is_awaited_shown_refused_or_withdrawn(self):
        """None is left lying at the hub without anybody having seen its face."""
        state = self.driven.kiosk._state
        for asked in self.driven.of(TakePicture):
            name = asked.capture_id
            assert (name in self.driven.withdrawn or name == state.visit.capture_id
                    or self.outcomes.get(name) in {"shown", "refused"})

    @invariant()
    def the_mirror_is_on_where_it_is_shown(self):
        assert self.driven.mirror == (self.driven.screen.name in {
            ScreenName.POSITION, ScreenName.COUNTDOWN})

    @invariant()
    def the_next_tick_is_not_in_the_past_for_ever(self):
        at_s = self.driven.kiosk.next_at_s
        if at_s is not None and at_s <= self.driven.now_s:
            self.driven.wait(0.0)
            again = self.driven.kiosk.next_at_s
            assert again is None or again > self.driven.now_s

    def teardown(self):
        """Nobody touches any more: the first screen comes, and withdrawals are still asked for."""
        self.driven.wait(LONGEST_VISIT_S)
        assert self.driven.name == "attract"
        pending = self.driven.kiosk._state.withdrawals._pending
        asked = self.driven.withdrawn
        self.driven.wait(31.0)
        for name in pending:
            assert self.driven.withdrawn.count(name) > asked.count(name)


def test_nothing_of_a_visit_changes_the_next_and_all_that_was_promised_is_kept():
    run_state_machine_as_test(AnyOrder, settings=settings(
        max_examples=80, stateful_step_count=30, deadline=None))
