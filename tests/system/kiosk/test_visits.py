"""The whole visit in a browser: sizes, languages, touch, keyboard and a button that sends keys."""

import pytest
from playwright.sync_api import expect

from tests.system.kiosk.browsing import visiting

VISITS = [("touch", (1280, 800), "en"), ("keyboard", (480, 800), "ar"), ("key", (800, 480), "en"),
          ("touch", (800, 480), "ar"), ("keyboard", (1280, 800), "ar"), ("key", (480, 800), "en")]
"""Each size in both languages, each way of pressing at two sizes."""


@pytest.mark.parametrize(("way", "size", "language"), VISITS)
def test_a_whole_visit(served, browser, way, size, language):
    name = f"{size[0]}x{size[1]}_{language}_{way}"
    with visiting(browser, served.url, name, size) as visitor:
        visitor.axe = (way, size, language) in VISITS[:3]  # each size once, either language
        def press(action):
            if way == "keyboard":
                visitor.press_by_keys(action)
            elif way == "touch":
                visitor.tap(action)
            else:
                visitor.page.evaluate("document.activeElement?.blur()")
                visitor.page.keyboard.press("Enter")

        visitor.at("attract")
        visitor.seen()
        if language == "ar":
            visitor.tap("language-ar")
            expect(visitor.page.locator("html")).to_have_attribute("dir", "rtl")
        visitor.check("1_attract")
        press("begin")
        visitor.at("consent")
        visitor.check("2_consent")
        # A button that sends Enter must not agree for anybody: it is read, then answered.
        (visitor.tap if way == "key" else press)("agree")
        visitor.at("position", "countdown", "captured", "reconstructing", "result")
        visitor.at("result")
        visitor.seen()
        visitor.check("6_result")
        for action in ("points", "sigma"):
            (visitor.tap if way == "key" else press)(action)
            visitor.check(f"7_{action}")
        visitor.tap("mesh")
        visitor.tap("measurements")
        visitor.check("8_measurements")
        visitor.tap("measurements")
        visitor.part("delete").first.focus()
        (visitor.tap if way == "key" else press)("delete")
        visitor.check("9_delete")
        (visitor.tap if way == "key" else press)("delete-yes")
        visitor.at("thanks")
        visitor.check("10_thanks")
        visitor.tap("done")
        visitor.at("attract")
        assert visitor.page.evaluate("document.documentElement.lang") == "en", "for the next one"
    assert not served.holds(served.pressed()[-1])
