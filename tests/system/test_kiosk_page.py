"""The visitor's page in a browser, with example data: how it looks, and what it says when."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from denseface.service.kiosk.page_messages import FromPage
from tests.kiosk_states import LANGUAGES, STATES, VECTORS, States, serving
from tests.system.running import REPOSITORY
from tests.viewer_page import KEEPS_PICTURES, PLAIN_PAGES, software_browser
from tests.waiting import LIMIT_MS, until

_SIZES = [(800, 480), (480, 800), (1280, 800)]
_WORDY = {"consent", "position_uncover", "result_measured", "keep", "trouble_worker", "leaving"}
"""States with much text: looked at in every language, the others in the longest and in one that
runs from right to left."""
_ALIKE = {"position_right", "position_up", "position_down", "position_closer", "position_back",
          "position_light", "consent_forever", "countdown_0", "captured", "failed_busy",
          "thanks_nothing", "trouble_disk", "trouble_hub"}
"""States that look like another one, by and large: not looked at here."""
_SEEN = [name for name in STATES if name not in _ALIKE]
_KEPT = {"de", "ar"}
_PICTURES = REPOSITORY / "out" / "kiosk" / "states"
"""Where screenshots of every state are kept: see `KEEPS_PICTURES`."""
_EXPECTED = ("WebSocket connection to", "a face cannot be shown FaceGridError", "[.WebGL-")
"""What a browser's console may say: of a server that is gone, a damaged face, slow rendering."""
_AXE = REPOSITORY / "service/kiosk/frontend/node_modules/axe-core/axe.min.js"
_LAYOUT = """() => {
  const faults = [];
  const out = "[inert], .visually-hidden, svg";
  const shown = (e) => e.getClientRects().length > 0 && !e.closest(out);
  const name = (e) => `${e.dataset.action ?? e.className} "${e.textContent.slice(0, 30)}"`;
  const all = [...document.querySelectorAll("#content *, .overlays *")].filter(shown);
  for (const e of all.filter((e) => !e.closest(".outline, .scan, .digits"))) {
    const { left, top, right, bottom, width } = e.getBoundingClientRect();
    if (width && (left < -1 || top < -1 || right > innerWidth + 1 || bottom > innerHeight + 1)) {
      faults.push(`${name(e)} leaves the screen`);
    }
    if (e.scrollHeight > e.clientHeight + 3 && e.matches(".card, .text, .hint, .button, .sheet")) {
      faults.push(`${name(e)} is cut`);
    }
  }
  for (const e of all.filter((e) => e.matches("button, input"))) {
    const { width, height } = e.getBoundingClientRect();
    if (width < 44 || height < 44) faults.push(`${name(e)} is small: ${width} x ${height}`);
  }
  const blocks = all.filter((e) => e.matches(
    "#content :is(button, .hint, h1, .facts, .card, .legend, .measurements)"));
  const place = new Map(blocks.map((e) => [e, e.getBoundingClientRect()]));
  for (const a of blocks) for (const b of blocks) {
    const [one, two] = [place.get(a), place.get(b)];
    if (a !== b && !a.contains(b) && !b.contains(a) && one.left < two.left &&
        Math.min(one.right, two.right) - Math.max(one.left, two.left) > 1 &&
        Math.min(one.bottom, two.bottom) - Math.max(one.top, two.top) > 1) {
      faults.push(`${name(a)} lies over ${name(b)}`);
    }
  }
  return faults;
}"""
"""What is cut, too small to be hit, beyond the screen, or over something else."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with software_browser(PLAIN_PAGES) as chromium:
        yield chromium


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    opened = browser.new_context(viewport={"width": 640, "height": 400}, reduced_motion="reduce")
    opened.set_default_timeout(LIMIT_MS)
    said: list[str] = []
    opened.on("console", lambda message: (
        said.append(message.text) if message.type in {"error", "warning"} else None))
    opened.on("weberror", lambda error: said.append(str(error.error)))
    yield opened
    opened.close()
    assert [text for text in said if not text.startswith(_EXPECTED)] == []


def _open(context: BrowserContext, states: States) -> Page:
    states.face = VECTORS / "dome.face"
    page = context.new_page()
    page.goto(states.url)
    _see(page, "attract")
    return page


def _see(page: Page, screen: str) -> None:
    expect(page.locator("#kiosk")).to_have_attribute("data-screen", screen, timeout=LIMIT_MS)


def _show(page: Page, states: States, name: str, **changes: Any) -> None:
    states.show(name, **changes)
    _see(page, STATES[name]["name"])


def _press(page: Page, action: str, **how: Any) -> None:
    page.locator(f'[data-action="{action}"]').click(**how)


def _kinds(said: list[FromPage]) -> list[str]:
    return [one.kind for one in said if one.kind != "touch"]


@pytest.fixture
def shown(context: BrowserContext) -> Iterator[tuple[Page, States]]:
    with serving() as states:
        yield _open(context, states), states


@pytest.mark.parametrize("language", LANGUAGES)
def test_nothing_is_cut_or_hidden_at_any_size(context, language):
    if KEEPS_PICTURES:
        _PICTURES.mkdir(parents=True, exist_ok=True)
    with serving(languages=(language, *(each for each in LANGUAGES if each != language))) as states:
        page = _open(context, states)
        faults = []
        for name in _SEEN:
            if name not in _WORDY and language not in _KEPT:
                continue
            _show(page, states, name)
            for width, height in _SIZES:
                page.set_viewport_size({"width": width, "height": height})
                faults += [f"{name} {width}x{height}: {fault}" for fault in page.evaluate(_LAYOUT)]
                if KEEPS_PICTURES and language in _KEPT and (width, height) == _SIZES[-1]:
                    page.screenshot(path=_PICTURES / f"{name}_{language}_{width}x{height}.png")
        assert faults == []


def test_every_screen_is_accessible(shown):
    page, states = shown
    page.evaluate(_AXE.read_text())
    faults = []
    for name in _SEEN:
        _show(page, states, name)
        found = page.evaluate(
            "axe.run({ runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'] })")
        assert found["passes"]
        faults += [f"{name}: {fault['id']}: {fault['nodes'][0]['html']}"
                   for fault in found["violations"]]
    assert faults == []


def test_a_double_tap_and_a_held_key_are_one_press(shown):
    page, states = shown
    _press(page, "begin", click_count=2)
    until(lambda: _kinds(states.said) == ["begin"])
    page.locator('[data-action="begin"]').focus()
    page.keyboard.down("Enter")
    for _ in range(5):
        page.keyboard.down("Enter")
    page.keyboard.up("Enter")
    _press(page, "speech")
    until(lambda: _kinds(states.said) == ["begin", "begin"])


def test_keys_do_all_and_a_key_alone_agrees_to_nothing(shown):
    page, states = shown
    page.keyboard.press("Enter")
    _show(page, states, "consent")
    page.keyboard.press("Enter")
    page.keyboard.press(" ")
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    _show(page, states, "position_well")
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    until(lambda: _kinds(states.said) == [
        "begin", "press", "press", "consent", "press", "cancel"])
    consent = next(said for said in states.said if said.kind == "consent")
    assert (consent.agreed, consent.language) == (False, "en"), "the first one is no"


def test_a_button_that_cannot_take_a_picture_says_nothing(shown):
    page, states = shown
    _show(page, states, "position_left")
    _press(page, "press", force=True)
    _press(page, "cancel")
    until(lambda: _kinds(states.said) == ["cancel"])


def test_the_consent_is_given_in_the_language_that_was_read(shown):
    page, states = shown
    _press(page, "language-ar")
    _show(page, states, "consent")
    assert page.evaluate("[document.documentElement.lang, document.documentElement.dir]") == [
        "ar", "rtl"]
    _press(page, "agree")
    until(lambda: _kinds(states.said) == ["consent"])
    assert (states.said[-1].agreed, states.said[-1].language) == (True, "ar")
    _show(page, states, "attract", visit=2)
    expect(page.locator("html")).to_have_attribute("lang", "en")


def test_arrows_stay_where_they_are_in_the_mirror(shown):
    page, states = shown
    for language in ("en", "ar"):
        _show(page, states, "attract")
        _press(page, f"language-{language}")
        for side, sign in (("left", -1), ("right", 1)):
            _show(page, states, f"position_{side}")
            arrow = page.locator(f".arrow.{side}").bounding_box()
            outline = page.locator(".outline").bounding_box()
            assert arrow is not None
            assert outline is not None
            assert sign * (arrow["x"] - outline["x"]) > 0
        # The next visit of another page.
        states.show("attract")


def test_hints_are_read_out_and_the_ring_fills(shown):
    page, states = shown
    _show(page, states, "position_closer")
    live = page.locator('[aria-live="assertive"]')
    expect(live).to_have_text("Come closer")
    _show(page, states, "position_well")
    expect(live).to_have_text("Very good, stay like this")
    expect(page.locator(".ring")).to_have_attribute("stroke-dasharray", "60 101")


def test_without_a_voice_it_says_so(shown):
    page, _ = shown
    page.evaluate("speechSynthesis.getVoices = () => []")
    _press(page, "speech")
    expect(page.get_by_role("status")).to_have_text(
        "This device has no voice in English. Everything is shown as text.")
    expect(page.locator('[data-action="speech"]')).to_have_attribute("aria-pressed", "false")


def test_with_a_voice_hints_are_spoken_until_the_visit_ends(shown):
    page, states = shown
    page.evaluate("""() => {
      window.spoken = [];
      const voice = speechSynthesis.getVoices()[0] ?? {};
      speechSynthesis.getVoices = () => [{ lang: "en-GB", localService: true }];
      window.SpeechSynthesisUtterance = class { constructor(text) { this.text = text; } };
      speechSynthesis.speak = (said) => window.spoken.push(said.text);
    }""")
    _press(page, "speech")
    _show(page, states, "position_closer")
    expect(page.locator(".hint-text")).to_have_text("Come closer")
    assert page.evaluate("spoken")[-1] == "Come closer"
    _show(page, states, "thanks_nothing")
    _show(page, states, "attract", visit=2)
    _show(page, states, "position_back", visit=2)
    assert "back" not in " ".join(page.evaluate("spoken"))


def test_the_face_is_looked_at_kept_and_deleted(shown):
    page, states = shown
    _show(page, states, "result_measured")
    until(lambda: _kinds(states.said) == ["drawn"])
    expect(page.locator("#kiosk")).to_have_attribute("data-seen", "true")
    for action in ("turn_left", "turn_up", "closer", "reset", "points", "mesh", "before", "after"):
        _press(page, action)
    _press(page, "sigma")
    expect(page.locator(".marks span")).to_have_text(["0.5 mm", "1 mm", "2 mm", "4 mm"])
    _press(page, "measurements")
    expect(page.locator(".measured b").first).to_have_text("138.4 mm")
    _press(page, "keep")
    _show(page, states, "keep", result=STATES["result_measured"]["result"])
    expect(page.get_by_role("dialog")).to_be_visible()
    expect(page.get_by_role("heading", name="Take your face home")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    _press(page, "delete")
    _press(page, "delete-no")
    _press(page, "delete")
    _press(page, "delete-yes")
    until(lambda: _kinds(states.said) == ["drawn", "keep", "delete"])


def test_the_last_picture_stays_until_the_face_is_drawn(shown):
    page, states = shown
    mirror = page.locator("canvas.mirror")
    _show(page, states, "position_well")
    expect(mirror).to_have_attribute("data-timestamp", "0")
    _show(page, states, "reconstructing")
    expect(mirror).to_be_visible()
    states.face = VECTORS / "messages.json"
    _show(page, states, "result")
    expect(page.locator(".unseen")).to_contain_text("cannot show the face")
    expect(mirror).to_be_visible()
    states.face = VECTORS / "dome.face"
    _show(page, states, "result", leaving_s=None)
    expect(mirror).to_be_hidden()
    until(lambda: _kinds(states.said) == ["drawn"])


def test_still_there_is_answered_by_one_large_button(shown):
    page, states = shown
    _show(page, states, "leaving")
    stay = page.locator('[data-action="stay"]')
    expect(stay).to_be_focused()
    states.said.clear()
    stay.click()
    until(lambda: "touch" in [said.kind for said in states.said])
    _show(page, states, "result")
    expect(stay).to_have_count(0)


def test_a_lost_server_is_told_and_comes_back_by_itself(shown):
    page, states = shown
    _show(page, states, "result")
    alert = page.get_by_role("alert")
    states.away = True
    states.drop()
    expect(alert).to_contain_text("lost its connection")
    states.away = False
    expect(alert).to_be_empty()
    _see(page, "result")


def test_a_page_of_another_version_loads_itself_anew(shown):
    page, states = shown
    page.evaluate("() => { window.old = true; }")
    states.hello = states.hello.model_copy(update={"version": "2"})
    with page.expect_event("load"):
        states.drop()
    assert page.evaluate("window.old") is None
    _see(page, "attract")
