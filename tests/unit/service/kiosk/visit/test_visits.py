"""Visits from the first screen to the last, and each transition on the way."""


import pytest

from denseface.service.kiosk import page_messages as page
from denseface.service.kiosk.page_messages import ScreenName, Trouble
from denseface.service.kiosk.visit import events
from denseface.service.kiosk.visit.effects import Consented, Mirror, TakePicture
from denseface.service.kiosk.visit.machine import Kiosk
from denseface.service.kiosk.visit.options import VisitOptions
from tests.unit.service.kiosk.visit.driving import DAY_S, GOOD, KEEP, NOBODY, Driven, hint

IN_VISIT = [name.value for name in ScreenName if name not in {
    ScreenName.ATTRACT, ScreenName.BUSY}]


def test_a_visit_from_the_first_screen_to_the_last():
    kiosk = Driven()
    assert kiosk.name == "attract"
    assert not kiosk.kiosk.busy
    kiosk.say(page.Begin)
    assert kiosk.name == "consent"
    assert kiosk.screen.consent.retention_s == DAY_S
    assert not kiosk.asked
    kiosk.say(page.Consent, agreed=True, language="fr")
    assert kiosk.name == "position"
    assert kiosk.asked == [Mirror(on=True)]
    kiosk.hints(*[GOOD] * 5)
    shown = []
    for _ in range(4):
        shown.append(kiosk.screen.countdown.left)
        assert not kiosk.pictures or shown[-1] == 0
        kiosk.wait(1.0)
    assert shown == [3, 2, 1, 0]
    assert kiosk.mirror
    assert kiosk.of(TakePicture) == [TakePicture(1, "c1", 1.0, consent=Consented(
        "built-in-1", "fr", DAY_S, "2026-11-29T12:00:00+00:00"))]
    kiosk.answer(events.FrameTaken)
    assert kiosk.name == "captured"
    assert not kiosk.mirror
    kiosk.wait(0.5)
    assert kiosk.name == "reconstructing"
    kiosk.face()
    assert kiosk.name == "result"
    assert kiosk.screen.result.capture_id == "c1"
    kiosk.say(page.Drawn, capture_id="c1")
    kiosk.say(page.Keep)
    assert kiosk.name == "result"
    assert kiosk.linked == ["c1"]
    kiosk.answer(events.LinksMade, KEEP)
    assert kiosk.name == "keep"
    assert kiosk.screen.keep == KEEP
    assert kiosk.screen.result is not None
    kiosk.say(page.Done)
    assert kiosk.name == "thanks"
    assert kiosk.screen.thanks == page.ThanksScreen(deleted=False, retention_s=DAY_S)
    kiosk.wait(6.0)
    assert kiosk.name == "attract"
    assert kiosk.kiosk.visit == 2
    assert not kiosk.kiosk.busy
    assert not kiosk.withdrawn
    assert kiosk.kiosk.next_at_s is None


# --- before a visit

@pytest.mark.parametrize("begins", [page.Begin, page.Press])
def test_the_button_on_the_screen_and_the_physical_one_begin_a_visit(begins):
    kiosk = Driven()
    kiosk.say(begins)
    kiosk.say(begins)
    assert (kiosk.name, kiosk.kiosk.visit) == ("consent", 1)


def test_nothing_begins_before_the_service_is_known_or_while_something_is_missing():
    kiosk = Driven()
    for trouble in Trouble:
        kiosk.service(trouble)
        kiosk.say(page.Begin)
        assert (kiosk.name, kiosk.screen.trouble) == ("attract", trouble)
    kiosk.service(None)
    assert kiosk.screen.trouble is None
    assert Kiosk(VisitOptions(), new_id=str, utc=str).screen(0.0).trouble is Trouble.HUB


# --- consent

def test_no_means_that_nothing_is_asked_of_the_sensor():
    kiosk = Driven().to("consent")
    kiosk.say(page.Consent, agreed=False, language="en")
    assert kiosk.screen.thanks == page.ThanksScreen(deleted=None)
    kiosk.wait(10)
    assert kiosk.name == "attract"
    assert not kiosk.asked


def test_where_the_operator_switched_it_off_nothing_is_asked_and_nothing_stored():
    kiosk = Driven(consent=False)
    kiosk.say(page.Begin)
    assert kiosk.name == "position"
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3.0)
    assert [one.consent for one in kiosk.of(TakePicture)] == [None]


def test_the_operators_own_text_is_shown_and_its_version_stored():
    text = {"en": ("Please.",)}
    kiosk = Driven(text=text, text_version="museum-3", links=True, retention_s=None).to("consent")
    assert kiosk.screen.consent == page.ConsentScreen(
        retention_s=None, text_version="museum-3", text=text, links=True)
    kiosk.say(page.Consent, agreed=True, language="ar")
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3.0)
    consented = kiosk.of(TakePicture)[0].consent
    assert (consented.text_version, consented.language, consented.retention_s) == (
        "museum-3", "ar", None)


def test_a_yes_to_what_is_no_longer_so_does_not_count():
    kiosk = Driven().to("consent")
    kiosk.service(None, 60.0)
    assert kiosk.screen.consent.retention_s == 60
    kiosk.say(page.Consent, visit=1, agreed=True, language="en")
    assert (kiosk.name, kiosk.kiosk.visit) == ("consent", 2)
    kiosk.say(page.Consent, agreed=True, language="en")
    assert kiosk.name == "position"


def test_what_is_promised_is_kept_though_it_changes_after_the_yes():
    kiosk = Driven().to("position")
    kiosk.service(None, 60.0)
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3.0)
    assert kiosk.of(TakePicture)[0].consent.retention_s == DAY_S


def test_the_button_does_not_agree_for_anybody():
    kiosk = Driven().to("consent")
    kiosk.say(page.Press)
    assert kiosk.name == "consent"


# --- the picture

def test_without_a_countdown_the_picture_is_taken_at_once():
    kiosk = Driven(countdown=0).to("position")
    kiosk.hints(*[GOOD] * 5)
    assert kiosk.screen.countdown.left == 0
    assert kiosk.pictures == ["c1"]


def test_the_button_takes_it_after_one_good_sample():
    kiosk = Driven().to("position")
    kiosk.say(page.Press)
    assert kiosk.name == "position"
    kiosk.hints(GOOD)
    assert kiosk.screen.position.can_press
    kiosk.say(page.Press)
    assert kiosk.name == "countdown"


def test_where_the_operator_wants_a_press_nothing_is_taken_without_one():
    kiosk = Driven(auto=False).to("position")
    kiosk.hints(*[GOOD] * 50)
    assert (kiosk.name, kiosk.screen.position.progress) == ("position", 1)
    kiosk.say(page.Press)
    assert kiosk.name == "countdown"


def test_after_long_the_button_takes_the_best_there_is():
    kiosk = Driven().to("position")
    kiosk.hints(*[hint("uncover")] * 149)
    kiosk.say(page.Press)
    assert not kiosk.screen.position.can_press
    kiosk.hints(*[hint("uncover")] * 2)
    assert kiosk.screen.position.with_warnings
    kiosk.say(page.Press)
    kiosk.hints(*[hint("look_here", face=False)] * 31)
    assert [one.best_of_s for one in kiosk.of(TakePicture)] == [0.3]
    kiosk.face()
    assert kiosk.screen.result.warnings == ("look_here",)


def test_a_second_press_a_held_key_and_key_repeat_are_one_picture():
    kiosk = Driven().to("position")
    kiosk.hints(GOOD)
    for _ in range(100):
        kiosk.say(page.Press)
        kiosk.wait(0.05)
    kiosk.answer(events.FrameTaken)
    kiosk.say(page.Press)
    kiosk.face()
    for _ in range(5):
        kiosk.say(page.Press)
    assert kiosk.pictures == ["c1"]
    assert kiosk.name == "result"


def test_who_goes_away_while_it_counts_finds_the_mirror_again():
    kiosk = Driven().to("countdown")
    kiosk.hints(*[NOBODY] * 6)
    assert kiosk.name == "countdown"  # a hand that comes back from the button
    kiosk.hints(GOOD, *[hint("look_here", face=False)] * 8)
    assert kiosk.name == "position"
    assert not kiosk.pictures
    kiosk.hints(*[GOOD] * 5)
    assert kiosk.screen.countdown.left == 3


def test_the_mirror_is_on_until_the_frame_is_taken_and_not_before_the_yes():
    kiosk = Driven().to("result")
    assert kiosk.of(Mirror) == [Mirror(on=True), Mirror(on=False)]


def test_a_face_may_come_with_its_frame_or_before_it_is_known():
    for name in ("taking", "captured", "reconstructing"):
        kiosk = Driven()
        getattr(kiosk, f"_to_{name}")()
        kiosk.face()
        assert kiosk.name == "result"
        kiosk.answer(events.FrameTaken)
        assert kiosk.name == "result"


@pytest.mark.parametrize(("reason", "why"), [
    ("sensor", "sensor"), ("no_sensor", "sensor"), ("sensor_gone", "sensor"),
    ("timeout", "sensor"), ("quality", "quality"), ("queue", "busy"), ("disk", "busy"),
    ("anything", "failed")])
def test_a_refused_press_says_why_and_goes_on_by_itself(reason, why):
    kiosk = Driven()
    kiosk._to_taking()
    kiosk.answer(events.CaptureRefused, reason, hint("move_back"))
    assert kiosk.screen.failed == page.FailedScreen(why=why, hint="move_back")
    assert not kiosk.mirror
    kiosk.wait(6)
    assert kiosk.name == "position"
    assert kiosk.mirror
    assert not kiosk.withdrawn


@pytest.mark.parametrize(("error", "why"), [("NoFaceError", "no_face"), ("Whatever", "failed")])
def test_a_picture_without_a_face_is_withdrawn_and_it_goes_on_by_itself(error, why):
    kiosk = Driven().to("reconstructing")
    kiosk.answer(events.FaceFailed, error)
    assert kiosk.screen.failed.why == why
    assert kiosk.withdrawn == ["c1"]
    kiosk.wait(6)
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3)
    assert kiosk.pictures == ["c1", "c2"]


def test_a_picture_that_never_comes_is_given_up():
    kiosk = Driven()
    kiosk._to_taking()
    kiosk.wait(20)
    assert kiosk.screen.failed.why == "failed"
    assert kiosk.withdrawn[:1] == ["c1"]


# --- the result

def test_again_keeps_the_consent_and_the_former_face_and_delete_removes_both():
    kiosk = Driven().to("keep")
    kiosk.say(page.Again)
    assert kiosk.name == "position"
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3)
    kiosk.face()
    assert kiosk.pictures == ["c1", "c2"]
    assert len({one.consent for one in kiosk.of(TakePicture)}) == 1
    assert not kiosk.withdrawn
    assert kiosk.screen.result.capture_id == "c2"
    kiosk.say(page.Delete)
    assert kiosk.withdrawn == ["c1", "c2"]
    kiosk.answer(events.Withdrawn)
    assert kiosk.name == "deleting"
    kiosk.answer(events.Withdrawn, capture_id="c1")
    assert kiosk.screen.thanks == page.ThanksScreen(deleted=True)


def test_delete_asks_until_the_hub_has_answered_also_after_the_visit():
    kiosk = Driven().to("deleting")
    kiosk.service(Trouble.HUB)
    kiosk.wait(50)
    assert (kiosk.name, kiosk.screen.trouble) == ("deleting", Trouble.HUB)
    kiosk.wait(20)
    assert kiosk.name == "attract"
    asked = len(kiosk.withdrawn)
    assert asked >= 5
    kiosk.wait(300)
    assert len(kiosk.withdrawn) >= asked + 9
    asked = len(kiosk.withdrawn)
    kiosk.service(None)
    kiosk.wait(0)  # at once when the hub is back
    assert len(kiosk.withdrawn) == asked + 1
    kiosk.answer(events.Withdrawn)
    kiosk.wait(300)
    assert len(kiosk.withdrawn) == asked + 1
    assert set(kiosk.withdrawn) == {"c1"}
    assert kiosk.name == "attract"


def test_links_are_made_once_and_only_where_they_may():
    kiosk = Driven().to("result")
    kiosk.say(page.Keep)
    kiosk.say(page.Keep)
    assert kiosk.linked == ["c1"]
    kiosk.answer(events.LinksMade, KEEP, capture_id="c9")
    assert kiosk.name == "result"
    closed = Driven().to("reconstructing")
    closed.face(can_keep=False)
    closed.say(page.Keep)
    assert not closed.linked


def test_links_that_cannot_be_made_are_said_and_may_be_asked_for_again():
    kiosk = Driven().to("result")
    kiosk.say(page.Keep)
    kiosk.answer(events.LinksFailed)
    assert (kiosk.name, kiosk.screen.result.no_links) == ("result", True)
    kiosk.say(page.Keep)
    assert (kiosk.linked, kiosk.screen.result.no_links) == (["c1", "c1"], False)
    kiosk.answer(events.LinksMade, KEEP)
    assert kiosk.name == "keep"


@pytest.mark.parametrize("name", ["result", "keep"])
@pytest.mark.parametrize("said", [page.Done, page.Cancel])
def test_who_has_seen_the_face_leaves_it_for_its_time(name, said):
    kiosk = Driven().to(name)
    kiosk.say(said)
    assert kiosk.screen.thanks == page.ThanksScreen(deleted=False, retention_s=DAY_S)
    assert not kiosk.withdrawn
    kiosk.say(page.Press)
    assert kiosk.name == "attract"


# --- cancel, leave, reload

@pytest.mark.parametrize(("name", "withdrawn"), [
    ("consent", []), ("position", []), ("countdown", []), ("taking", ["c1"]),
    ("captured", ["c1"]), ("reconstructing", ["c1"]), ("deleting", ["c1"]),
    ("failed", ["c1"])])
def test_cancel_anywhere_leads_to_the_first_screen_and_withdraws_a_picture(name, withdrawn):
    kiosk = Driven()
    getattr(kiosk, f"_to_{name}")()
    kiosk.say(page.Cancel)
    assert (kiosk.name, kiosk.withdrawn, kiosk.mirror) == ("attract", withdrawn, False)


@pytest.mark.parametrize(("name", "withdrawn"), [
    ("attract", []), ("position", []), ("taking", ["c1"]), ("reconstructing", ["c1"]),
    ("result", ["c1"]), ("keep", ["c1"]), ("thanks", ["c1"])])
def test_a_page_that_goes_ends_the_visit_and_what_was_not_seen_is_withdrawn(name, withdrawn):
    kiosk = Driven()
    getattr(kiosk, f"_to_{name}")()
    kiosk.happen(events.PageWent())
    assert (kiosk.name, kiosk.withdrawn, kiosk.mirror) == ("attract", withdrawn, False)


def test_a_face_that_was_seen_stays_when_the_page_goes():
    kiosk = Driven().to("result")
    kiosk.say(page.Drawn, capture_id="c1")
    kiosk.happen(events.PageWent())
    assert not kiosk.withdrawn


@pytest.mark.parametrize("name", IN_VISIT)
def test_where_nobody_touches_the_first_screen_comes(name):
    kiosk = Driven().to(name)
    kiosk.wait(200)
    assert kiosk.name == "attract"
    assert not kiosk.mirror


@pytest.mark.parametrize("name", ["consent", "position", "reconstructing", "result", "keep"])
def test_it_is_asked_for_ten_seconds_whether_somebody_is_still_there(name):
    kiosk = Driven().to(name)
    shown = []
    while kiosk.name == name:
        shown.append(kiosk.screen.leaving_s)
        kiosk.wait(0.5)
    assert [one for one in shown if one is not None][::2] == [*range(10, 0, -1)]
    assert shown[0] is None


@pytest.mark.parametrize("name", ["consent", "position", "result", "keep"])
def test_any_touch_begins_the_time_anew_and_ends_none(name):
    kiosk = Driven().to(name)
    idle_s = next(n for n in range(1, 200) if _leaves(name, n))
    for _ in range(5):
        kiosk.wait(idle_s - 1)
        assert kiosk.screen.leaving_s is not None
        kiosk.say(page.Touch)
        assert kiosk.screen.leaving_s is None
    kiosk.wait(idle_s)
    assert kiosk.name == "attract"


def _leaves(name, seconds):
    kiosk = Driven().to(name)
    kiosk.wait(seconds)
    return kiosk.name == "attract"


def test_a_face_in_the_mirror_counts_as_a_touch_and_a_poster_does_not_for_ever():
    kiosk = Driven(auto=False).to("position")
    kiosk.hints(*[hint("come_closer")] * 600)
    assert (kiosk.name, kiosk.screen.leaving_s) == ("position", None)
    kiosk.hints(*[GOOD] * 1300)
    assert kiosk.name == "attract"


def test_a_poster_whose_pictures_fail_does_not_keep_the_kiosk():
    kiosk = Driven().to("position")
    for _ in range(400):
        kiosk.hints(*[GOOD] * 10)
        if kiosk.pictures and kiosk.name == "countdown" and not kiosk.screen.countdown.left:
            kiosk.answer(events.FaceFailed, "NoFaceError")
    assert kiosk.name == "attract"
    assert len(kiosk.pictures) < 25


# --- what is missing

@pytest.mark.parametrize("trouble", [*Trouble])
@pytest.mark.parametrize("name", [*IN_VISIT, "attract"])
def test_what_is_missing_is_said_on_every_screen_until_it_is_back(name, trouble):
    kiosk = Driven().to(name)
    kiosk.service(trouble)
    assert kiosk.screen.trouble is trouble
    assert kiosk.name == {"countdown": "position"}.get(name, name)
    kiosk.service(None)
    assert kiosk.screen.trouble is None


def test_the_mirror_goes_on_by_itself_when_the_sensor_is_back():
    kiosk = Driven().to("position")
    kiosk.hints(GOOD)
    kiosk.service(Trouble.SENSOR)
    assert kiosk.screen.position == page.PositionScreen()
    kiosk.hints(*[GOOD] * 9)  # pictures that were under way
    kiosk.say(page.Press)
    assert (kiosk.name, kiosk.mirror) == ("position", True)
    kiosk.service(None)
    kiosk.hints(*[GOOD] * 5)
    assert kiosk.name == "countdown"


@pytest.mark.parametrize(("trouble", "name"), [
    (Trouble.SENSOR, "position"), (Trouble.HUB, "position"), (Trouble.DISK, "position"),
    (Trouble.WORKER, "countdown")])
def test_a_picture_that_is_being_taken_when_something_goes(trouble, name):
    kiosk = Driven()
    kiosk._to_taking()
    kiosk.service(trouble)
    assert kiosk.name == name
    assert kiosk.withdrawn == ([] if name == "countdown" else ["c1"])
    kiosk.answer(events.FrameTaken)
    assert kiosk.name == ("captured" if name == "countdown" else name)


def test_a_face_of_a_picture_that_was_given_up_is_not_shown_for_the_next_one():
    kiosk = Driven()
    kiosk._to_taking()
    kiosk.service(Trouble.SENSOR)
    kiosk.service(None)
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3)
    assert kiosk.pictures == ["c1", "c2"]
    kiosk.face(capture_id="c1")
    assert (kiosk.name, kiosk.withdrawn[0]) == ("countdown", "c1")
    kiosk.face()
    assert kiosk.screen.result.capture_id == "c2"


def test_who_goes_while_the_picture_is_taken_does_not_stop_it():
    kiosk = Driven()
    kiosk._to_taking()
    kiosk.hints(*[NOBODY] * 20)
    assert (kiosk.name, kiosk.pictures) == ("countdown", ["c1"])


def test_a_face_that_waits_for_a_worker_comes_when_there_is_one():
    kiosk = Driven().to("reconstructing")
    kiosk.service(Trouble.WORKER)
    kiosk.wait(45)
    assert kiosk.name == "reconstructing"
    kiosk.service(None)
    kiosk.face()
    assert kiosk.name == "result"


def test_late_answers_about_a_withdrawn_picture_have_it_withdrawn_again():
    """The hub may have said that nothing is there before the press came to it."""
    kiosk = Driven().to("captured")
    kiosk.say(page.Cancel)
    kiosk.answer(events.Withdrawn, visit=1)
    kiosk.answer(events.FaceCame, page.ResultScreen(capture_id="c1"), visit=1)
    assert kiosk.withdrawn == ["c1", "c1"]
    assert kiosk.name == "attract"


def test_what_is_said_of_a_former_visit_changes_nothing():
    kiosk = Driven().to("position")
    kiosk.say(page.Cancel)
    kiosk.to("position")
    before = kiosk.screen
    for said in (page.Cancel, page.Done, page.Delete, page.Press, page.Touch, page.Begin):
        kiosk.say(said, visit=1)
    kiosk.happen(events.PageWent(visit=1))
    kiosk.happen(events.HintCame(GOOD, visit=1))
    assert kiosk.screen == before


def test_options_out_of_their_bounds_are_named():
    for wrong in ({"countdown": 11}, {"best_of_s": 1.5}, {"result_s": 0.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            VisitOptions(**wrong)


def test_statistics_say_why_people_wait_and_what_became_of_visits():
    kiosk = Driven().to("position")
    kiosk.hints(*[hint("move_back")] * 21, *[GOOD] * 5)
    kiosk.wait(3)
    kiosk.answer(events.FaceFailed, "NoFaceError")
    kiosk.wait(6)
    kiosk.hints(*[GOOD] * 5)
    kiosk.wait(3)
    kiosk.face()
    kiosk.say(page.Keep)
    kiosk.answer(events.LinksMade, KEEP)
    kiosk.say(page.Done)
    figures = kiosk.kiosk.hint_statistics.as_dict()
    assert figures["seconds"]["move_back"] == pytest.approx(2.1)
    assert next(iter(figures["seconds"])) == "move_back"
    assert (figures["visits"], figures["captures"], figures["faces"], figures["kept"]) == (
        1, 2, 1, 1)
    assert figures["failures"] == {"no_face": 1}
    assert figures["ends"] == {"done": 1}


def test_a_busy_page_says_so_and_what_is_missing():
    kiosk = Driven().to("position")
    kiosk.service(Trouble.SENSOR)
    shown = kiosk.kiosk.busy_screen()
    assert (shown.name, shown.trouble, shown.visit) == ("busy", Trouble.SENSOR, 1)
