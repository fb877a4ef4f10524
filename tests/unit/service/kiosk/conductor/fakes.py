"""A hub, browsers' sockets and links that do as a test says."""

import asyncio
import contextlib
import json
from collections import deque

from denseface.service.client import PublishedHint, PublishedPreview
from denseface.service.errors import ClientTimeoutError
from denseface.service.kiosk.conductor.conductor import Conductor, ConductorOptions
from denseface.service.kiosk.conductor.kept_withdrawals import KeptWithdrawals
from denseface.service.kiosk.page_messages import Hello, KeepScreen
from denseface.service.kiosk.visit.events import ServiceIs
from denseface.service.kiosk.visit.machine import Kiosk
from denseface.service.kiosk.visit.options import VisitOptions
from tests.unit.service.faces import small_face
from tests.waiting import LIMIT_S

FACE = small_face()


class FakeHub:
    """Answers at once, or fails as it is told."""

    def __init__(self):
        self.said = []
        """What was asked: the call and the capture."""
        self.errors = {}
        """Call -> errors, each raised once, before it answers."""
        self.hold = asyncio.Event()
        """Faces wait for it."""
        self.hold.set()
        self.watching = 0
        self.pictures = asyncio.Queue()
        self.consents = []

    def _fail(self, call, capture_id=""):
        self.said.append((call, capture_id))
        if self.errors.get(call):
            raise self.errors[call].pop(0)

    async def press(self, capture_id=None, **named):
        self.consents.append(named.get("consent"))
        self._fail("press", capture_id)
        return capture_id

    async def get(self, capture_id, **_):
        await self.hold.wait()
        self._fail("get", capture_id)
        return FACE

    async def withdraw(self, capture_id, **_):
        self._fail("withdraw", capture_id)
        return 1

    async def previews(self, **_):
        self.said.append(("previews", ""))
        self.watching += 1
        try:
            while True:
                yield await self.pictures.get()
        finally:
            self.watching -= 1

    def calls(self, call):
        return [one for name, one in self.said if name == call]


def picture(number, *codes):
    hint = PublishedHint("s", number, codes, "", {"distance_mm": 700.0})
    return PublishedPreview("e", number, number, "s", (4, 3), b"jpeg%d" % number, hint, None)


class FakeLinks:
    def __init__(self):
        self.reachable = True
        self.forgotten = []

    async def make(self, capture_id, language):
        assert capture_id
        return KeepScreen(page=f"http://h/{language}", qr=("01", "10"), uses=5, expires_s=60)

    async def forget(self, capture_id):
        self.forgotten.append(capture_id)


class Browser:
    """A page as the server sees it: what it sends, and what it was sent."""

    def __init__(self):
        self.incoming = asyncio.Queue()
        self.hello = None
        self.screens = []
        self.binary = []
        """Kind, head and payload, with the number of screens before it."""
        self.closed = None
        self.reads = asyncio.Event()
        self.reads.set()
        self.changed = asyncio.Event()
        self.task = None

    async def accept(self):
        pass

    async def receive(self):
        return await self.incoming.get()

    async def send_text(self, text):
        await self.reads.wait()
        said = json.loads(text)
        if said["kind"] == "hello":
            self.hello = said
        else:
            self.screens.append(said)
        self.changed.set()

    async def send_bytes(self, data):
        await self.reads.wait()
        length = int.from_bytes(data[1:5], "little")
        self.binary.append((data[0], json.loads(data[5:5 + length]), data[5 + length:],
                            len(self.screens)))
        self.changed.set()

    async def close(self, code=1000):
        self.closed = code
        self.changed.set()

    @property
    def screen(self):
        return self.screens[-1] if self.screens else None

    def say(self, kind, *, visit=None, **fields):
        said = {"kind": kind, "visit": self.screen["visit"] if visit is None else visit, **fields}
        self.send(text=json.dumps(said))

    def send(self, **message):
        self.incoming.put_nowait({"type": "websocket.receive", **message})

    async def leave(self):
        self.incoming.put_nowait({"type": "websocket.disconnect", "code": 1001})
        await self.task

    async def until(self, true):
        """Wait until something is so of it."""
        async with asyncio.timeout(LIMIT_S):
            while not (found := true()):
                self.changed.clear()
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self.changed.wait(), 0.02)
        return found

    async def shows(self, name, **fields):
        """Wait until it shows a screen, and give it."""
        await self.until(lambda: self.screen and self.screen["name"] == name and all(
            self.screen[key] == value for key, value in fields.items()))
        return self.screen


QUICK = {"countdown": 0, "sample_gap_s": 0.001, "feedback_s": 0.01, "failed_s": 0.2,
         "thanks_s": 0.2}


class Setup:
    """A conductor with its fakes."""

    def __init__(self, folder, *, links=None, hub=None, **options):
        self.hub = hub or FakeHub()
        self.links = links
        self.folder = folder
        ids = (f"capture-{number}" for number in range(1, 100))
        self.kiosk = Kiosk(VisitOptions(**QUICK | options), new_id=lambda: next(ids),
                           utc=lambda: "2026-01-31T12:00:00+00:00")
        self.conductor = Conductor(
            self.kiosk, self.hub, KeptWithdrawals(folder, "ipc:///hub"),
            ConductorOptions(Hello(languages=("en", "de"), version="1")), links)
        self.browsers = deque()

    async def __aenter__(self):
        self.conductor.start()
        self.conductor.service_is(ServiceIs(None, 3600.0))
        return self

    async def __aexit__(self, *_):
        for browser in self.browsers:
            if not browser.task.done():
                await browser.leave()
        await self.conductor.close(0)

    async def browser(self):
        browser = Browser()
        browser.task = asyncio.create_task(self.conductor.page(browser))
        self.browsers.append(browser)
        await browser.until(lambda: browser.screen or browser.closed)
        return browser

    async def to_position(self, browser):
        browser.say("begin")
        await browser.shows("consent")
        browser.say("consent", agreed=True, language="de")
        await browser.shows("position")

    async def to_result(self, browser):
        await self.to_position(browser)
        await self.press(browser)
        return await browser.shows("result")

    async def press(self, browser):
        """Let the mirror show somebody who stands well."""
        screens = len(browser.screens)
        while all(one["name"] == "position" for one in browser.screens[screens:]):
            self.hub.pictures.put_nowait(picture(0))
            await asyncio.sleep(0.002)
        while not self.hub.pictures.empty():
            self.hub.pictures.get_nowait()


def timed_out():
    return ClientTimeoutError("no answer")
