"""Whole visits with a hub and browsers that do as they are told."""

import asyncio
import json

import pytest

from denseface.service.errors import CaptureFailedError, PressRefusedError
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.kiosk.conductor import conductor as module
from denseface.service.kiosk.page_messages import FACE as FACE_KIND
from denseface.service.kiosk.page_messages import MIRROR, Trouble
from denseface.service.kiosk.visit.events import ServiceIs
from tests.unit.service.kiosk.conductor.fakes import (
    FACE,
    FakeHub,
    FakeLinks,
    Setup,
    picture,
    timed_out,
)
from tests.waiting import LIMIT_S


def run(main):
    asyncio.run(asyncio.wait_for(main(), LIMIT_S))


def test_a_visit_from_the_first_screen_to_the_last(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page = await setup.browser()
            assert page.hello["languages"] == ["en", "de"]
            result = await setup.to_result(page)
            kind, head, grid, screens = page.binary[-1]
            assert (kind, head) == (FACE_KIND, {"capture_id": "capture-1", "visit": 1})
            assert grid == encode_face_grid(FACE)
            assert page.screens[screens]["name"] == "result"  # the face came just before
            assert result["result"]["dense_points"] == len(FACE.dense)
            page.say("drawn", capture_id="capture-1")
            page.say("done")
            thanks = await page.shows("thanks")
            assert thanks["thanks"] == {"deleted": False, "retention_s": 3600.0}
            assert (await page.shows("attract"))["visit"] == 2
            assert setup.conductor.figures.as_dict()["drawn"] == 1
            assert setup.hub.calls("withdraw") == []
            consent, = setup.hub.consents
            assert consent.model_dump(mode="json") == {
                "text_version": "built-in-1", "language": "de", "retention_s": 3600.0,
                "at": "2026-01-31T12:00:00Z"}
    run(main)


def test_the_sensor_is_asked_for_nothing_before_yes_and_after_the_picture(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page = await setup.browser()
            page.say("next")
            page.say("begin")
            await page.shows("consent")
            page.say("next")
            page.say("press")
            page.say("consent", agreed=False, language="en")
            await page.shows("thanks")
            await page.shows("attract")
            assert setup.hub.said == []
            await setup.to_result(page)
            assert setup.hub.watching == 0
            assert len(setup.hub.calls("previews")) == 1
    run(main)


def test_the_mirror_gives_one_picture_for_each_request_and_the_newest_alone(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk", auto=False) as setup:
            page = await setup.browser()
            await setup.to_position(page)
            for number in range(5):
                setup.hub.pictures.put_nowait(picture(number, "come_closer"))
            await page.until(lambda: page.screen["position"]["hint"] == "come_closer")
            assert page.binary == []  # nobody has asked
            page.say("next")
            await page.until(lambda: page.binary)
            assert page.binary[0][:3] == (
                MIRROR, {"timestamp_us": 4, "width": 4, "height": 3}, b"jpeg4")
            page.say("next")  # there is no newer one yet
            page.say("next")
            await asyncio.sleep(0.05)
            assert len(page.binary) == 1
            for number in (5, 6, 7):
                setup.hub.pictures.put_nowait(picture(number, "come_closer"))
            await page.until(lambda: len(page.binary) > 1)
            await asyncio.sleep(0.05)
            assert [one[2] for one in page.binary[1:]] == [b"jpeg5"]
    run(main)


def test_other_pages_are_told_that_it_is_busy_and_get_nothing(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page, other = await setup.browser(), await setup.browser()
            await setup.to_position(page)
            await other.shows("busy", visit=1)
            for said in ("next", "cancel", "press", "delete", "done", "touch"):
                other.say(said)
            await setup.press(page)
            await page.shows("result")
            for said in ("again", "delete", "keep"):
                other.say(said)
            late = await setup.browser()
            assert (await late.shows("busy"))["result"] is None
            assert other.binary == late.binary == []
            assert {one["name"] for one in other.screens} == {"attract", "busy"}
            assert page.screen["name"] == "result"
            page.say("done")
            for one in (page, other, late):
                await one.shows("attract", visit=2)
            await setup.to_position(other)
            await page.shows("busy")
    run(main)


def test_a_page_that_is_closed_frees_the_kiosk_and_what_it_did_not_see_goes(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page, other = await setup.browser(), await setup.browser()
            setup.hub.hold.clear()
            await setup.to_position(page)
            await setup.press(page)
            await page.shows("reconstructing")
            await page.leave()
            await other.shows("attract", visit=2)
            await other.until(lambda: setup.hub.calls("withdraw") == ["capture-1"])
            setup.hub.hold.set()
            await setup.to_position(other)
            await asyncio.sleep(0.05)
            assert page.binary == other.binary == []  # nobody gets the face of the visit before
            assert other.screen["name"] == "position"
    run(main)


def test_what_is_said_of_another_visit_changes_nothing(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page = await setup.browser()
            await setup.to_result(page)
            for visit in (0, 2, 99):
                for said in ("delete", "done", "again", "cancel"):
                    page.say(said, visit=visit)
            page.say("drawn", visit=2, capture_id="capture-1")
            page.say("drawn", capture_id="capture-2")
            await asyncio.sleep(0.05)
            assert page.screen["name"] == "result"
            assert setup.conductor.figures.as_dict()["drawn"] == 0
    run(main)


def test_delete_is_said_when_the_hub_has_answered_and_links_end_before(tmp_path):
    async def main():
        links = FakeLinks()
        async with Setup(tmp_path / "kiosk", links=links) as setup:
            page = await setup.browser()
            await setup.to_result(page)
            page.say("keep")
            keep = await page.shows("keep")
            assert keep["keep"]["page"] == "http://h/de"  # in the visitor's language
            setup.hub.errors["withdraw"] = [timed_out(), timed_out()]
            page.say("delete")
            await page.shows("deleting")
            await page.until(lambda: setup.hub.calls("withdraw"))
            assert page.screen["name"] == "deleting"
            assert links.forgotten == ["capture-1"]
            pending = tmp_path / "kiosk" / "withdrawals" / "capture-1"
            assert pending.read_text() == "ipc:///hub"
            assert pending.stat().st_mode & 0o777 == 0o600
            await page.until(lambda: len(setup.hub.calls("withdraw")) == 3)
            assert (await page.shows("thanks"))["thanks"]["deleted"] is True
            assert not pending.exists()
    module_wait(main, module)


def module_wait(main, patched):
    """Run with withdrawals that are repeated soon."""
    before, patched._AGAIN_S = patched._AGAIN_S, 0.02
    try:
        run(main)
    finally:
        patched._AGAIN_S = before


def test_a_withdrawal_goes_on_when_the_kiosk_starts_again(tmp_path):
    async def main():
        hub = FakeHub()
        hub.errors["withdraw"] = [timed_out()]
        async with Setup(tmp_path / "kiosk", hub=hub) as setup:
            page = await setup.browser()
            await setup.to_result(page)
            page.say("delete")
            await page.until(lambda: hub.calls("withdraw"))
        (tmp_path / "kiosk" / "withdrawals" / "elsewhere").write_text("ipc:///other")
        (tmp_path / "kiosk" / "withdrawals" / "..not-an-id").write_text("ipc:///hub")
        again = FakeHub()
        again.errors["withdraw"] = [timed_out()]
        async with Setup(tmp_path / "kiosk", hub=again) as setup:
            page = await setup.browser()
            await page.until(lambda: again.calls("withdraw") == ["capture-1"] * 2)
            assert page.screen["name"] == "attract"
        left = {path.name for path in (tmp_path / "kiosk" / "withdrawals").iterdir()}
        assert left == {"elsewhere", "..not-an-id"}
    module_wait(main, module)


def test_a_press_of_which_nobody_knows_is_withdrawn(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page = await setup.browser()
            setup.hub.errors["press"] = [timed_out()]
            await setup.to_position(page)
            await setup.press(page)
            assert (await page.shows("failed"))["failed"]["why"] == "sensor"
            await page.until(lambda: setup.hub.calls("withdraw") == ["capture-1"])
            await page.shows("position")
    run(main)


@pytest.mark.parametrize(("call", "error", "why", "hint"), [
    ("press", PressRefusedError("refused", "quality", ("face_dark",), "more light"), "quality",
     "face_dark"),
    ("press", PressRefusedError("refused", "no_sensor"), "sensor", None),
    ("get", CaptureFailedError("capture-1", "NoFaceError", "there is none"), "no_face", None),
    ("get", timed_out(), "failed", None)])
def test_why_there_is_no_face_is_said_and_it_goes_on(call, error, why, hint, tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page = await setup.browser()
            setup.hub.errors[call] = [error]
            await setup.to_position(page)
            await setup.press(page)
            assert (await page.shows("failed"))["failed"] == {"why": why, "hint": hint}
            await page.shows("position")
            assert setup.hub.calls("withdraw") == (["capture-1"] if call == "get" else [])
    run(main)


def test_what_is_missing_is_shown_on_every_page_and_is_back_by_itself(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk", auto=False) as setup:
            page, other = await setup.browser(), await setup.browser()
            await setup.to_position(page)
            setup.conductor.service_is(ServiceIs(Trouble.SENSOR, 3600.0))
            await page.shows("position", trouble="sensor")
            await other.shows("busy", trouble="sensor")
            setup.conductor.service_is(ServiceIs(None, 3600.0))
            await page.shows("position", trouble=None)
    run(main)


def test_the_button_beside_the_screen_is_that_of_the_visit(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk", auto=False) as setup:
            setup.conductor.button()  # nobody would see anything
            first, second = await setup.browser(), await setup.browser()
            setup.conductor.button()
            await first.shows("consent")
            await second.shows("busy")
            first.say("consent", agreed=True, language="en")
            await first.shows("position")
            for number in range(3):
                setup.hub.pictures.put_nowait(picture(number))
            await first.until(lambda: first.screen["position"]["can_press"])
            for _ in range(5):
                setup.conductor.button()
            await first.shows("result")
            assert setup.hub.calls("press") == ["capture-1"]
    run(main)


@pytest.mark.parametrize(("message", "code"), [
    ({"text": "{"}, 1008), ({"text": json.dumps({"kind": "begin"})}, 1008),
    ({"text": json.dumps({"kind": "begin", "visit": 1, "more": 1})}, 1008),
    ({"text": json.dumps({"kind": "begin", "visit": -1})}, 1008),
    ({"text": json.dumps({"kind": "purge", "visit": 1})}, 1008),
    ({"text": json.dumps({"kind": "drawn", "visit": 1, "capture_id": "../x"})}, 1008),
    ({"text": "[]"}, 1008), ({"bytes": b"{}"}, 1003)])
def test_a_page_that_says_what_is_none_of_its_messages_is_closed(message, code, tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page, other = await setup.browser(), await setup.browser()
            page.send(**message)
            await page.task
            assert page.closed == code
            await setup.to_position(other)
    run(main)


def test_a_page_that_says_too_much_is_closed_and_the_visit_of_another_goes_on(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            page, other = await setup.browser(), await setup.browser()
            await setup.to_position(other)
            for _ in range(200):
                page.say("next")
            await page.task
            assert page.closed == 1008
            assert other.screen["name"] == "position"
    run(main)


def test_pages_are_bounded(tmp_path):
    async def main():
        async with Setup(tmp_path / "kiosk") as setup:
            pages = [await setup.browser() for _ in range(9)]
            assert [page.closed for page in pages] == [None] * 8 + [1013]
            assert setup.conductor.figures.pages == {"opened": 8, "turned_away": 1}
    run(main)


def test_a_page_that_does_not_take_what_is_sent_is_closed_and_nothing_waits_for_it(
        tmp_path, monkeypatch):
    monkeypatch.setattr("denseface.service.kiosk.conductor.page._SEND_S", 0.2)

    async def main():
        async with Setup(tmp_path / "kiosk", auto=False) as setup:
            page, other = await setup.browser(), await setup.browser()
            await setup.to_position(page)
            page.reads.clear()
            for number in range(20):
                page.say("next")
                setup.hub.pictures.put_nowait(picture(number, "come_closer"))
                await asyncio.sleep(0.001)
            await page.task
            assert page.closed is None, "it has not said too much"
            assert len(page.binary) <= 1
            await other.shows("attract", visit=2)
    run(main)
