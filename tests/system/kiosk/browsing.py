"""A visitor in Debian's Chromium: touches, keys, what is on the screen and what the page does."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect

from tests.system.running import REPOSITORY
from tests.viewer_page import KEEPS_PICTURES, PLAIN_PAGES, software_browser
from tests.waiting import LIMIT_MS

__all__ = ["Visitor", "chromium", "visiting"]

_AXE = REPOSITORY / "service/kiosk/frontend/node_modules/axe-core/axe.min.js"
_TAGS = ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa"]
_PICTURES = REPOSITORY / "out" / "kiosk"
"""Where screenshots of every state are kept: see `KEEPS_PICTURES`."""
_RUN_AXE = """(tags) => axe.run(document, {runOnly: {type: "tag", values: tags}}).then((found) =>
  found.violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html).join(" ")}`))"""
_TARGETS = """() => [...document.querySelectorAll("button, input, a")].map((one) => {
  const box = one.getBoundingClientRect();
  return [one.dataset.action ?? one.tagName, box.width, box.height, getComputedStyle(one).opacity];
}).filter(([, width, height]) => width > 0 && (width < 43.5 || height < 43.5))"""
_OUTSIDE = """() => [...document.querySelectorAll("button, h1, h2, p")].filter((one) => {
  const box = one.getBoundingClientRect();
  return box.width > 1 && box.height > 1 && getComputedStyle(one).visibility === "visible" &&
    !one.closest(".visually-hidden, [inert], .text, .sheet, .measurements") &&
    (box.left < -1 || box.top < -1 || box.right > innerWidth + 1 || box.bottom > innerHeight + 1);
}).map((one) => `${one.dataset.action ?? one.tagName} ${one.textContent}`)"""
"""What can be seen of whose words a part lies outside of the screen."""


@contextmanager
def chromium() -> Iterator[Browser]:
    """Run a browser that renders by software."""
    with software_browser(PLAIN_PAGES, "--disable-quic", "--disable-sync",
                          "--js-flags=--expose-gc") as browser:
        yield browser


@dataclass
class Visitor:
    """A page, and what went wrong in it."""

    page: Page
    url: str
    name: str
    wrong: list[str] = field(default_factory=list)
    axe: bool = True
    """Whether `check` asks axe-core, which takes a second."""

    @property
    def root(self) -> Locator:
        """The page's root, which says what is shown."""
        return self.page.locator("#kiosk")

    @property
    def visit(self) -> int:
        """The number of the visit."""
        return int(self.root.get_attribute("data-visit") or 0)

    @property
    def screen(self) -> str:
        """The name of the screen."""
        return self.root.get_attribute("data-screen") or ""

    def at(self, *names: str) -> None:
        """Wait for one of some screens."""
        expect(self.root).to_have_attribute("data-screen", re.compile(f"^({'|'.join(names)})$"),
                                            timeout=LIMIT_MS)

    def seen(self) -> None:
        """Wait for the face to be drawn."""
        expect(self.root).to_have_attribute("data-seen", "true", timeout=LIMIT_MS)

    def trouble(self, name: str) -> None:
        """Wait for what is gone; empty for nothing."""
        expect(self.root).to_have_attribute("data-trouble", name, timeout=LIMIT_MS)

    def part(self, action: str) -> Locator:
        """Give a button or slider."""
        return self.page.locator(f"[data-action={action}]:visible")

    def tap(self, action: str) -> None:
        """Touch a button in its middle."""
        self.part(action).first.tap(timeout=LIMIT_MS)

    def press_by_keys(self, action: str) -> None:
        """Go to a button by Tab and press it by Enter."""
        wanted = self.part(action).first
        wanted.wait_for(timeout=LIMIT_MS)
        for _ in range(60):
            if wanted.evaluate("one => one === document.activeElement"):
                self.page.keyboard.press("Enter")
                return
            self.page.keyboard.press("Tab")
        raise AssertionError(f"{action} is not reached by Tab")

    def picture(self, state: str) -> None:
        """Wait until what fades in has done so, and keep a screenshot if they are kept."""
        self.page.evaluate(
            "() => Promise.allSettled(document.getAnimations().filter((one) =>"
            " one.effect?.getComputedTiming().endTime < 5000).map((one) => one.finished))")
        if KEEPS_PICTURES:
            _PICTURES.mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=_PICTURES / f"{self.name}_{state}.png", timeout=LIMIT_MS)

    def check(self, state: str) -> None:
        """Keep a picture; no rule of WCAG is broken, no target small, nothing cut off."""
        self.picture(state)
        if self.axe:
            if not self.page.evaluate("() => 'axe' in window"):
                self.page.evaluate(_AXE.read_text())
            assert self.page.evaluate(_RUN_AXE, _TAGS) == [], state
        assert self.page.evaluate(_TARGETS) == [], state
        assert self.page.evaluate(_OUTSIDE) == [], state


@contextmanager
def visiting(
    browser: Browser, url: str, name: str = "", size: tuple[int, int] = (1280, 800), *,
    still: bool = True,
) -> Iterator[Visitor]:
    """Open a page as a visitor finds it; afterwards nothing must have gone wrong in it.

    Parameters
    ----------
    name : of its screenshots
    still : what moves by itself does not, which software renders slowly
    """
    context: BrowserContext = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, has_touch=True,
        reduced_motion="reduce" if still else "no-preference")
    page = context.new_page()
    page.set_default_timeout(LIMIT_MS)
    visitor = Visitor(page, url, name)
    page.on("console", lambda said: (
        visitor.wrong.append(f"{said.type}: {said.text}") if said.type == "error" else None))
    page.on("pageerror", lambda error: visitor.wrong.append(str(error)))
    home = urlsplit(url).netloc

    def asked(where: str) -> None:
        if urlsplit(where).scheme not in ("blob", "data") and urlsplit(where).netloc != home:
            visitor.wrong.append(f"asked for {where}")

    page.on("request", lambda request: asked(request.url))
    page.on("websocket", lambda socket: asked(socket.url))
    try:
        page.goto(url)
        yield visitor
    finally:
        context.close()
    assert visitor.wrong == []

