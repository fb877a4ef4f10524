"""`denseface view` as a process, and its page in a browser."""

import os
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from denseface.service.export import save_face
from tests.system.running import RECORDINGS, REPOSITORY, killed_at_the_end
from tests.system.test_operator_browser import check
from tests.unit.service.faces import small_face
from tests.viewer_page import software_browser
from tests.waiting import LIMIT_MS, LIMIT_S, until

expect.set_options(timeout=LIMIT_MS)
_OPENED = "#!/bin/sh\nprintf %s \"$1\" > \"$OPENED\"\n"
"""A browser that only says what it was asked to open."""
_Running = tuple["subprocess.Popen[str]", str]
"""The command, and where its page is."""


@contextmanager
def viewing(*arguments: object, **environment: str) -> Iterator[_Running]:
    """Run the command, and give where its page is."""
    with killed_at_the_end(subprocess.Popen(
            [sys.executable, "-m", "denseface", "view", *map(str, arguments)], cwd=REPOSITORY,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=os.environ | environment)) as process:
        try:
            url = process.stdout.readline().strip()
            assert url.startswith("http://127.0.0.1:"), process.stderr.read()
            yield process, url
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(LIMIT_S)


@pytest.fixture(scope="module")
def desk(tmp_path_factory) -> Path:
    """A folder with a browser, a face of some hundred points, and a mesh."""
    folder = tmp_path_factory.mktemp("desk")
    (folder / "browser").write_text(_OPENED)
    (folder / "browser").chmod(stat.S_IRWXU)
    face = small_face(60, 48, 2.5)
    save_face(face, folder / "face.npz")
    save_face(face, folder / "face.stl")
    return folder


@pytest.fixture(scope="module")
def served(desk) -> Iterator[_Running]:
    """The page of a face, a recording of three frames, and a mesh."""
    with viewing(desk / "face.npz", RECORDINGS / "frontal_700.oni", desk / "face.stl",
                 "--preset", "faithful", "--once", BROWSER=str(desk / "browser"),
                 OPENED=str(desk / "opened")) as running:
        yield running


@pytest.fixture(scope="module")
def page(served) -> Iterator[Page]:
    """The page; nothing may be complained of, or asked elsewhere."""
    _, url = served
    said: list[str] = []
    with software_browser() as chromium:
        opened = chromium.new_page(viewport={"width": 800, "height": 480},
                                   reduced_motion="reduce")
        opened.set_default_timeout(LIMIT_MS)
        opened.on("console", lambda message: said.append(message.text)
                  if message.type in ("error", "warning") else None)
        opened.on("pageerror", lambda error: said.append(str(error)))
        opened.on("request", lambda request: None if request.url.startswith((url, "blob:"))
                  or request.url == url.replace("http", "ws") + "open"
                  else said.append(request.url))
        opened.goto(url)
        yield opened
    assert said == []


def look(page: Page) -> np.ndarray:
    """What is seen of the picture, (h, w, 3)."""
    data = np.frombuffer(page.locator(".stages").screenshot(), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR).astype(np.int16)


def shown(page: Page) -> np.ndarray:
    """What is seen once two looks at it are the same."""
    expect(page.locator(".stage[aria-busy]")).to_have_count(0)
    looks = [look(page)]

    def still() -> bool:
        looks.append(look(page))
        return np.array_equal(looks[-1], looks[-2])

    until(still)
    return looks[-1]


def differs(one: np.ndarray, other: np.ndarray) -> float:
    """The part of all pixels that are clearly others."""
    return float((np.abs(one - other).max(axis=2) > 12).mean())


def test_a_browser_is_opened_on_a_page_that_shows_the_face(served, page, desk):
    until(lambda: (desk / "opened").exists() and (desk / "opened").read_text() == served[1])
    expect(page).to_have_title("face.npz, frontal_700.oni, face.stl – denseface")
    expect(page.locator(".figures")).to_contain_text("Dense points")
    expect(page.locator(".provenance")).to_contain_text("denseface 0")
    picture = shown(page)
    height, width, _ = picture.shape
    middle = picture[height // 3:2 * height // 3, 2 * width // 5:3 * width // 5].reshape(-1, 3)
    assert np.abs(middle - picture[4, 4]).max(axis=1).min() > 12, "all of it is face"


def test_keys_turn_it_and_change_what_is_shown(page):
    front = shown(page)
    for key, as_before in (("ArrowRight", False), ("0", True), ("3", False), ("1", True),
                           ("b", False), ("b", True)):
        page.keyboard.press(key)
        until(lambda same=as_before: (differs(look(page), front) < 0.002) == same)
    page.locator("[data-action=sigma]").click()
    expect(page.locator(".legend")).to_contain_text("0.5 mm")
    page.locator("[data-action=mesh]").click()
    expect(page.locator(".legend")).to_be_hidden()


def test_the_mouse_turns_it_and_others_beside_it_as_well(page):
    page.locator("[data-action=beside-2]").click()
    expect(page.locator(".stage")).to_have_count(2)
    before = shown(page)
    box = page.locator(".stage canvas").first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y + 10, steps=3)
    page.mouse.up()
    half = before.shape[1] // 2
    for side in (slice(half), slice(half, None)):
        until(lambda side=side: differs(look(page)[:, side], before[:, side]) > 0.02)
    after = look(page)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    with page.expect_download() as download:
        page.keyboard.press("s")
    assert download.value.suggested_filename == "face.png"
    saved = cv2.imread(str(download.value.path())).astype(np.int16)
    rows, columns = np.minimum(saved.shape[:2], after.shape[:2])
    saved, after = saved[40:rows, :columns], after[40:rows, :columns]
    bright = after.max(axis=2) > 100
    assert bright.mean() > 0.1
    assert (np.abs(saved - after).max(axis=2) < 40)[bright].mean() > 0.95
    page.locator("[data-action=show-2]").click()
    expect(page.locator("[data-action=sigma]")).to_be_hidden()
    mesh = shown(page)
    page.locator("[data-action=beside-0]").click()
    page.keyboard.press("3")
    page.keyboard.press("b")
    page.locator("[data-action=show-2]").click()
    until(lambda: differs(look(page), mesh) < 0.002)  # what it has not is not taken from it
    expect(page.locator(".figures")).to_contain_text("Triangles")


def test_the_frames_of_a_recording_are_gone_through(page, tmp_path):
    page.locator("[data-action=show-1]").click()
    expect(page.locator(".measured dt").first).to_have_text("Face width")
    page.keyboard.press("1")
    page.keyboard.press("b")
    first = shown(page)
    expect(page.locator("[data-action=previous]")).to_have_attribute("aria-disabled", "true")
    page.keyboard.press("n")
    expect(page.locator("h1")).to_have_text("frontal_700.oni, frame 1")
    until(lambda: 0.001 < differs(look(page), first) < 0.5)  # another frame, seen alike
    expect(page.locator(".frame")).to_have_text("Frame 1 of 0 to 2")
    page.locator(".report summary").click()
    page.set_viewport_size({"width": 390, "height": 844})
    check(page, tmp_path, "telephone")


def test_strangers_are_refused_and_it_ends_with_its_page(served, page):
    process, url = served

    def status(path: str, **headers: str) -> int:
        try:
            with urlopen(Request(path, headers=headers), timeout=LIMIT_S) as answer:  # noqa: S310
                return int(answer.status)
        except HTTPError as error:
            return error.code

    root = url[:url.index("/", 8) + 1]
    assert status(url) == 200
    for wrong in (root, url[:-3] + "/", root + "view.js"):
        assert status(wrong) == 404
    assert status(url, Host="evil.example") == 403
    assert status(url, Origin="http://evil.example") == 403
    page.goto("about:blank")
    assert process.wait(LIMIT_S) == 0
    assert process.stderr.read() == "closing the page ends it, and so does Ctrl-C\n"
