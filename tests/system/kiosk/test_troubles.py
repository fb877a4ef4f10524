"""What goes wrong during a visit: the page says so in a sentence, which goes away by itself."""

import gc

import psutil
import pytest
from playwright.sync_api import expect

from tests.system.kiosk.browsing import visiting
from tests.waiting import until


@pytest.fixture(autouse=True)
def all_is_well(served):
    """Leave the sensor as the next test wants it."""
    yield
    if not served.control.plugged:
        served.control.replug()


def to_result(visitor):
    """Go from the first screen to the face."""
    visitor.at("attract")
    visitor.tap("begin")
    visitor.at("consent")
    visitor.tap("agree")
    visitor.at("result")
    visitor.seen()


def home(visitor):
    """End the visit."""
    visitor.tap("done")
    visitor.at("thanks")
    visitor.tap("done")
    visitor.at("attract")


def told(visitor, served, unplug, replug, name):
    """Something is gone and comes back: told in words, with nothing to press, and taken back."""
    unplug()
    visitor.trouble(name)
    sentences = visitor.page.locator(".alerts p").all_inner_texts()
    assert len(sentences) == 2
    assert all(len(words) > 10 for words in sentences)
    assert visitor.page.locator(".alerts button").count() == 0, "there is nothing to retry"
    replug()
    visitor.trouble("")
    assert served.up.process.poll() is None


def test_the_sensor_is_unplugged_on_every_screen(served, browser):
    plugs = served.control.unplug, served.control.replug, "sensor"
    with visiting(browser, served.url, "unplugged") as visitor:
        visitor.at("attract")
        told(visitor, served, *plugs)
        visitor.tap("begin")
        visitor.at("consent")
        told(visitor, served, *plugs)
        served.control.unplug()
        visitor.trouble("sensor")
        visitor.check("consent")
        served.control.replug()
        visitor.trouble("")
        visitor.tap("agree")
        visitor.at("result")
        visitor.seen()
        told(visitor, served, *plugs)
        served.control.unplug()
        visitor.trouble("sensor")
        visitor.check("result")
        visitor.tap("done")
        visitor.at("thanks")
        visitor.trouble("sensor")
        visitor.tap("done")
        visitor.at("attract")
        visitor.check("attract")
        served.control.replug()
        visitor.trouble("")


def test_a_worker_that_is_killed_costs_time_and_no_face(served, browser):
    with visiting(browser, served.url, "killed") as visitor:
        visitor.at("attract")
        worker = served.up.stop_worker_amid_a_job()  # else the face may come before it is killed
        visitor.tap("begin")
        visitor.tap("agree")
        until(lambda: worker.status() == psutil.STATUS_STOPPED)
        visitor.at("captured", "reconstructing")
        worker.kill()
        visitor.at("result")
        visitor.seen()
        home(visitor)


def test_the_hub_begins_anew(served, browser):
    with visiting(browser, served.url, "hub") as visitor:
        to_result(visitor)
        hub = served.process("hub")
        hub.suspend()
        visitor.trouble("hub")
        visitor.check("gone")
        hub.kill()
        visitor.trouble("")
        visitor.tap("delete")
        visitor.tap("delete-yes")
        visitor.at("thanks")
        assert not served.holds(served.pressed()[-1])
        visitor.tap("done")
        visitor.at("attract")
        visitor.trouble("")


def test_nothing_is_asked_of_the_sensor_before_yes_nor_after_no(served, browser):
    before = served.previews()
    taken = len(served.pressed())
    with visiting(browser, served.url, "refused") as visitor:
        visitor.at("attract")
        visitor.tap("begin")
        visitor.at("consent")
        visitor.page.keyboard.press("Enter")
        assert served.previews() == before
        visitor.tap("refuse")
        visitor.at("thanks")
        visitor.check("thanks")
        visitor.tap("done")
        visitor.at("attract")
        assert served.previews() == before
        assert len(served.pressed()) == taken


def test_of_two_browsers_one_has_the_visit(served, browser):
    with visiting(browser, served.url, "first") as first, \
            visiting(browser, served.url, "second") as second:
        second.at("attract")
        first.at("attract")
        first.tap("begin")
        first.at("consent")
        second.at("busy")
        second.check("busy")
        second.page.keyboard.press("Enter")
        second.page.keyboard.press("Escape")
        first.tap("cancel") if first.part("cancel").count() else first.page.keyboard.press("Escape")
        first.at("attract")
        second.at("attract")
        second.tap("begin")
        second.at("consent")
        first.at("busy")
        second.tap("refuse")
        first.at("attract")


def test_a_held_button_is_one_capture(served, browser):
    """The key repeats, as one does that is held, on every screen of the way."""
    taken = len(served.pressed())
    with visiting(browser, served.url, "held") as visitor:
        visitor.at("attract")
        visitor.tap("begin")
        visitor.tap("agree")
        visitor.at("position", "countdown", "captured", "reconstructing", "result")
        visitor.page.evaluate("document.activeElement?.blur()")
        for _ in range(10):
            visitor.page.keyboard.down("Enter")
        visitor.page.keyboard.up("Enter")
        visitor.at("result")
        visitor.seen()
        for _ in range(3):
            visitor.page.keyboard.down("Enter")
        visitor.page.keyboard.up("Enter")
        assert len(served.pressed()) == taken + 1
        home(visitor)


def test_several_visits_leave_nothing_in_the_page(served, browser):
    with visiting(browser, served.url, "again", (800, 480)) as visitor:
        def used():
            visitor.page.evaluate("gc()")
            return visitor.page.evaluate("performance.memory.usedJSHeapSize")

        to_result(visitor)
        home(visitor)
        nodes = visitor.page.locator("*").count()
        before = used()
        for _ in range(2):
            to_result(visitor)
            home(visitor)
        gc.collect()
        until(lambda: used() < before + 3_000_000)
        assert visitor.page.locator("*").count() == nodes
        expect(visitor.page.locator("canvas.mirror")).to_have_count(1)
