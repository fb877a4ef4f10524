"""The operator's page in a browser, as it is built, before an example hub."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.operator_states import Operated, serving_operator
from tests.system.running import REPOSITORY
from tests.viewer_page import KEEPS_PICTURES, PLAIN_PAGES, software_browser
from tests.waiting import LIMIT_MS, until

AXE = REPOSITORY / "service/kiosk/frontend/node_modules/axe-core/axe.min.js"
RULES = "{ runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'] }"
SIZES = {"desk": (1280, 800), "telephone": (390, 844), "small": (480, 800)}
expect.set_options(timeout=LIMIT_MS)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with software_browser(PLAIN_PAGES) as chromium:
        yield chromium


@pytest.fixture
def operated() -> Iterator[Operated]:
    with serving_operator() as operated:
        yield operated


@pytest.fixture
def opened(browser, operated):
    """Opens the page in a language and a size; nothing may be complained of, or asked elsewhere."""
    contexts, said = [], []

    def open_page(language: str = "en", size: str = "desk") -> Page:
        width, height = SIZES[size]
        context = browser.new_context(
            locale=language, viewport={"width": width, "height": height})
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(LIMIT_MS)
        page.on("console", lambda message: said.append(f"{message.text} {message.location}")
                if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: None if request.url.startswith(
            operated.url.removesuffix("/operator")) else said.append(request.url))
        page.goto(operated.url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert said == []


def log_in(page: Page, operated: Operated) -> None:
    expect(page.locator("#token")).to_be_focused()
    page.keyboard.type(operated.secret)
    page.keyboard.press("Enter")
    expect(page.locator(".captures tbody tr").first).to_be_visible()
    expect(page.locator(".dead tbody tr")).to_have_count(1)


def check(page: Page, pictures: Path, name: str) -> None:
    """Look at a state: nobody is kept out of it, nothing lies beyond the edge."""
    if KEEPS_PICTURES:
        page.screenshot(path=pictures / f"{name}.png", full_page=True)
    page.evaluate(AXE.read_text())
    found = page.evaluate(f"axe.run(document, {RULES})")["violations"]
    assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found] == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    small = page.evaluate("""[...document.querySelectorAll("button, a, select, input")]
        .map((one) => [one.textContent, one.getBoundingClientRect()])
        .filter(([, at]) => at.width && (at.width < 44 || at.height < 44)).map(([text]) => text)""")
    assert small == []


@pytest.mark.parametrize(("language", "size"), [
    ("en", "desk"), ("de", "small"), ("ar", "telephone")])
def test_nobody_is_kept_out_at_any_size(opened, operated, tmp_path, language, size):
    page = opened(language, size)
    expect(page.locator("html")).to_have_attribute("dir", "rtl" if language == "ar" else "ltr")
    expect(page.locator("#token")).to_be_focused()
    check(page, tmp_path, "login")
    log_in(page, operated)
    check(page, tmp_path, "page")
    page.locator("[data-action=delete]").first.click()
    expect(page.locator("dialog")).to_be_visible()
    check(page, tmp_path, "question")
    page.keyboard.press("Escape")
    expect(page.locator("dialog")).to_have_count(0)
    expect(page.locator("[data-action=delete]").first).to_be_focused()
    assert "purge" not in [name for name, _ in operated.hub.said]
    assert "operator." not in page.locator("body").inner_text()


def test_an_operator_looks_after_captures_and_sensors(opened, operated):
    page = opened()
    log_in(page, operated)
    rows = page.locator(".captures tbody tr")
    expect(rows).to_have_count(10)
    until(lambda: page.evaluate("document.querySelector('.captures img').naturalWidth") == 192)
    page.locator("[data-action=older]").click()
    expect(rows).to_have_count(14)
    page.locator("[data-action=report]").first.click()
    expect(page.locator("dialog pre")).to_contain_text('"dense_points"')
    page.locator("[data-action=close]").click()
    page.locator("[data-action=delete]").first.click()
    page.locator("[data-action=confirm]").click()
    expect(rows).to_have_count(13)
    expect(page.locator(".said")).to_have_text("The capture was deleted.")
    assert operated.forgotten == ["capture-1"]
    page.locator("[data-action=retry]").click()
    expect(page.locator(".said")).to_have_text("The capture is tried again.")
    page.locator("[data-action=drop]").click()
    page.locator("[data-action=confirm]").click()
    expect(page.locator(".dead .none")).to_be_visible()
    page.locator("[data-action=restart]").first.click()
    page.locator("[data-action=confirm]").click()
    expect(page.locator(".said")).to_have_text("The sensor is being restarted.")
    done = [said for said in operated.hub.said if said[0] in (
        "purge", "retry", "drop", "restart_sensor")]
    assert done == [("purge", "capture-1"), ("retry", "dead-1"), ("drop", "dead-1"),
                    ("restart_sensor", "kiosk/412")]
    with page.expect_download() as download:
        page.locator(".log a").click()
    assert download.value.suggested_filename == "denseface.log"


def test_what_changes_is_shown_by_itself(opened, operated):
    page = opened()
    log_in(page, operated)
    expect(page.locator(".alarm")).to_be_hidden()
    operated.kiosk["consent"] = False
    expect(page.locator(".alarm")).to_have_text(
        "Visitors are not asked for their consent. You have to have it otherwise.")
    assert page.locator(".alarm").evaluate("one => getComputedStyle(one).backgroundColor") == (
        "rgb(163, 24, 15)")
    expect(page.locator("[data-tile='sensor kiosk/413'] .mark")).to_have_class("mark bad")
    page.locator("[data-action=restart]").nth(1).focus()
    operated.hub.silent = True
    expect(page.locator("[data-tile=hub] .mark")).to_have_text("Does not answer")
    operated.hub.silent = False
    expect(page.locator("[data-tile=worker] .mark")).to_have_text("1 ready")


def test_a_language_that_is_chosen_is_kept_and_the_session_too(opened, operated):
    page = opened()
    log_in(page, operated)
    page.locator("header select").select_option("de")
    expect(page.locator("header h1")).to_have_text("Betrieb")
    page.reload()
    expect(page.locator("header h1")).to_have_text("Betrieb")
    page.locator("[data-action=logout]").click()
    expect(page.locator("#token")).to_be_visible()
    page.reload()
    expect(page.locator("#token")).to_be_visible()
