"""The viewer of faces in a browser, by software WebGL and under the kiosk's own policy."""

import time
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page

from tests.viewer_page import FRONTEND, serving_page, software_browser
from tests.waiting import LIMIT_S

_SIZE = {"width": 400, "height": 320}
_SLACK_BYTES = 3_000_000
"""By which a heap may differ between two looks at it; a sample face has 8 MB."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("page")
    (folder / "sample.face").symlink_to(FRONTEND / "public/sample.face")
    (folder / "dome.face").symlink_to(FRONTEND / "test/vectors/dome.face")
    with serving_page(folder) as url:
        yield url


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with software_browser("--js-flags=--expose-gc") as chromium:
        yield chromium


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    opened = browser.new_page(viewport=_SIZE)
    said: list[str] = []
    # That a context was lost and restored is told as a plain log line.
    opened.on("console", lambda message: (
        said.append(message.text) if message.type in ("error", "warning") else None))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.set_default_timeout(LIMIT_S * 1000)
    opened.goto(address)
    opened.evaluate("page.open(false)")
    yield opened
    opened.close()
    assert said == []


def picture(page: Page) -> NDArray[np.int16]:
    """What is seen, (320, 400, 3), when nothing moves any more."""
    page.evaluate("page.still()")
    decoded = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    return cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB).astype(np.int16)


def covered(shown: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Where something else than the page's background is."""
    return np.asarray(np.abs(shown - np.array([0x10, 0x14, 0x18])).max(axis=2) > 6)


def test_a_face_is_drawn_in_its_colours_and_then_nothing_runs(page: Page) -> None:
    assert page.evaluate("page.show('sample.face')") is True
    shown = picture(page)
    face = covered(shown)
    assert 0.15 < face.mean() < 0.6
    assert not face[:, :60].any()
    assert not face[:, -60:].any()
    red, green, blue = np.median(shown[face], axis=0)
    assert red > green + 15
    assert green > blue + 15
    before = page.evaluate("page.drawings")
    page.evaluate("new Promise((done) => setTimeout(done, 500))")
    assert page.evaluate("page.drawings") == before


@pytest.mark.parametrize("by", ["touch", "button"])
def test_it_turns_by_itself_until_it_is_touched(page: Page, by: str) -> None:
    page.evaluate("page.show('dome.face')")
    page.evaluate("page.viewer.turning = true")
    count = page.evaluate("page.drawings")
    page.evaluate("""async (count) => {
      while (page.drawings < count) await new Promise((done) => setTimeout(done, 20));
    }""", count + 20)
    if by == "touch":
        page.mouse.click(200, 160)
        assert page.evaluate("page.touches") == 1
    else:
        page.evaluate("page.viewer.rotate(15, 0)")
    assert page.evaluate("page.viewer.turning") is False
    page.evaluate("page.still()")


def double_tap(page: Page) -> None:
    """Tap twice within a tenth of a second, by the events' own stamps: however long that takes."""
    session, began_s = page.context.new_cdp_session(page), time.time()
    for number, kind in enumerate(("mousePressed", "mouseReleased") * 2):
        session.send("Input.dispatchMouseEvent", {
            "type": kind, "x": 200, "y": 160, "button": "left", "clickCount": 1 + number // 2,
            "timestamp": began_s + 0.03 * number})


def test_gestures_change_what_is_seen_and_a_double_tap_undoes_it(page: Page) -> None:
    def drag() -> None:
        page.mouse.move(200, 160)
        page.mouse.down()
        page.mouse.move(120, 170, steps=4)
        page.mouse.up()

    def keys() -> None:
        page.locator("canvas").focus()
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("+")

    page.evaluate("page.show('sample.face')")
    before = picture(page)
    for gesture in (drag, lambda: page.mouse.wheel(0, -600), keys):
        gesture()
        assert np.abs(picture(page) - before).mean() > 2
        double_tap(page)
        assert np.abs(picture(page) - before).mean() < 1


def test_two_fingers_bring_it_nearer_and_move_it(page: Page) -> None:
    page.evaluate("page.show('sample.face')")
    before = covered(picture(page)).mean()
    touches = page.context.new_cdp_session(page)

    def fingers(kind: str, apart: int, middle: int = 200) -> None:
        points = [] if kind == "touchEnd" else [{"x": middle - apart, "y": 160, "id": 1},
                                                {"x": middle + apart, "y": 160, "id": 2}]
        touches.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    fingers("touchStart", 30)
    for apart in (40, 50, 60):
        fingers("touchMove", apart)
    fingers("touchEnd", 0)
    near = covered(picture(page))
    assert near.mean() > 1.5 * before
    fingers("touchStart", 60)
    for middle in (210, 230, 250):
        fingers("touchMove", 60, middle)
    fingers("touchEnd", 0)
    moved = covered(picture(page))
    assert 40 < moved[160].argmax() - near[160].argmax() < 60, "along with the fingers"


def test_confidence_points_and_the_initial_cloud_look_different(page: Page) -> None:
    page.evaluate("page.show('sample.face')")
    mesh = picture(page)
    page.evaluate("page.viewer.mode = 'sigma'")
    sigma = picture(page)
    blues = np.median(sigma[covered(mesh)], axis=0)
    assert blues[2] > blues[0] + 20, "sure is blue, and most of it is"
    page.evaluate("page.viewer.mode = 'points'")
    points = picture(page)
    assert 0.2 * covered(mesh).mean() < covered(points).mean() < 0.95 * covered(mesh).mean()
    page.evaluate("page.viewer.mode = 'mesh'; page.viewer.blend = 0.5")
    half = picture(page)
    difference = np.abs(half - mesh).max(axis=2)
    assert difference[:, :190].max() <= 2, "dense on the left"
    assert difference[:, 210:].max() > 40, "measured points on the right"
    page.evaluate("page.viewer.blend = 1")
    assert np.abs(picture(page) - mesh).max() <= 2


def test_a_face_that_is_forgotten_is_gone(page: Page) -> None:
    page.evaluate("page.show('sample.face')")
    page.evaluate("page.viewer.turning = true; page.viewer.clear(); page.viewer.turning = false")
    assert not covered(picture(page)).any()
    assert page.evaluate("page.show('dome.face')") is True
    assert covered(picture(page)).any()


def test_a_lost_context_comes_back(page: Page) -> None:
    page.evaluate("page.show('sample.face')")
    before = picture(page)
    page.evaluate("page.loseContext()")
    page.evaluate("page.viewer.rotate(5, 0)")
    page.evaluate("page.viewer.reset()")
    page.evaluate("page.restoreContext()")
    assert np.abs(picture(page) - before).mean() < 1


def test_a_face_that_comes_without_a_context_is_shown_when_that_is_back(page: Page) -> None:
    page.evaluate("page.loseContext()")
    page.evaluate("() => { window.shown = page.show('sample.face') }")
    page.evaluate("page.restoreContext()")
    assert page.evaluate("shown") is True
    assert covered(picture(page)).any()


def test_without_webgl_there_is_a_picture(page: Page) -> None:
    page.evaluate("""() => {
      const given = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind === "webgl2" ? null : given.call(this, kind, ...rest);
      };
      page.open(false);
    }""")
    # A graphics card that was asked before is not asked again.
    assert page.evaluate("page.flat") is True
    assert page.evaluate("page.viewer.rotatable") is False
    assert page.evaluate("page.show('sample.face')") is True
    shown = picture(page)
    assert 0.15 < covered(shown).mean() < 0.6
    page.evaluate("page.viewer.blend = 0.5; page.viewer.mode = 'sigma'; page.viewer.turning = true")
    assert np.abs(picture(page) - shown).mean() > 2


def heap(page: Page) -> int:
    page.evaluate("gc()")
    return int(page.evaluate("performance.memory.usedJSHeapSize"))


def test_a_hundred_faces_in_a_row_leave_nothing(page: Page) -> None:
    page.evaluate("page.showMany('dome.face', 6)")
    held, before = page.evaluate("page.held"), heap(page)
    page.evaluate("page.showMany('dome.face', 99)")
    assert page.evaluate("page.held") <= held + 2
    assert heap(page) < before + _SLACK_BYTES


def test_viewers_that_are_closed_leave_nothing(page: Page) -> None:
    page.evaluate("page.openMany('dome.face', 2)")
    before = heap(page)
    page.evaluate("page.openMany('dome.face', 20)")
    page.evaluate("page.close()")
    assert heap(page) < before + _SLACK_BYTES
