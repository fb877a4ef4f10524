"""Visits from the first screen to the last, and each transition on the way."""


from denseface.service.kiosk import page_messages as page
from denseface.service.kiosk.page_messages import ScreenName
from denseface.service.kiosk.visit import events
from denseface.service.kiosk.visit.effects import Consented, Mirror, TakePicture
from tests.unit.service.kiosk.visit.driving import DAY_S, GOOD, KEEP, Driven

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
    assert kiosk.of(TakePicture) == [TakePicture(1, "c1", 0.3, anyhow=False, consent=Consented(
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
