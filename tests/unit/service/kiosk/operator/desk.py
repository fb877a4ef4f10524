"""A hub with captures, and the operator's page before it."""

import asyncio
from contextlib import asynccontextmanager

import httpx2
from starlette.applications import Starlette

from denseface.recon.face import Face
from denseface.service.errors import (
    ClientTimeoutError,
    RequestFailedError,
    UnknownCaptureError,
)
from denseface.service.kiosk.operator.desk import Desk
from denseface.service.kiosk.operator.page import OperatorPage
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.kiosk.web.app import guarded
from denseface.service.kiosk.web.asgi import App
from denseface.service.kiosk.web.files import Files
from denseface.service.protocol.message_base import CaptureSummary, DeadLetter
from denseface.service.protocol.messages import Status
from tests.unit.service.faces import small_face

ORIGIN = "http://127.0.0.1:8080"
JSON = {"Origin": ORIGIN}
STATUS = Status(
    epoch="1f", sequence=7, hub_version="0.1.0", sensors=("desk/1",), workers=("desk/2",),
    pressed=0, queued=1, working=1, done=5, failed=1, dead=1, refused={}, presses_refused={},
    since_start={"accepted": 7}, latencies={}, restarts={}, free_bytes=10**10, kept_bytes=10**7)
DEAD = DeadLetter(
    sequence=3, capture_id="dead-1", error="WorkerGone", message="gave up", attempts=3,
    accepted_at="2026-11-29T10:00:00Z", finished_at="2026-11-29T10:01:00Z")


class Hub:
    """Does what it is told, and keeps what that was."""

    def __init__(self) -> None:
        self.faces: dict[str, Face] = {f"capture-{n}": small_face() for n in (1, 2)}
        self.said: list[tuple[str, object]] = []
        self.silent = False
        self.gets = 0

    def _hear(self, *said) -> None:
        if self.silent:
            raise ClientTimeoutError("no answer from the hub")
        self.said.append(said)

    async def get(self, capture_id: str, **_: float) -> Face:
        self.gets += 1
        if capture_id not in self.faces:
            raise UnknownCaptureError(capture_id)
        return self.faces[capture_id]

    async def status(self, **_: float) -> Status:
        self._hear("status", None)
        return STATUS

    async def captures(self, last: int = 20, **_: float):
        self._hear("captures", last)
        return tuple(CaptureSummary(
            capture_id=name, sequence=n, state="done", accepted_at="2026-11-29T10:00:00Z",
            attempts=1) for n, name in enumerate(self.faces))[:last]

    async def purge(self, *, capture_id: str | None = None, **_: float) -> int:
        self._hear("purge", capture_id)
        return int(self.faces.pop(capture_id, None) is not None)

    async def dead(self, **_: float):
        self._hear("dead", None)
        yield DEAD

    async def retry(self, capture_id: str, **_: float) -> None:
        self._hear("retry", capture_id)
        if capture_id != "dead-1":
            raise RequestFailedError("it is no dead letter")

    async def drop(self, capture_id: str, **_: float) -> None:
        self._hear("drop", capture_id)

    async def restart_sensor(self, name: str, **_: float) -> None:
        self._hear("restart_sensor", name)


class Page:
    """The application, and the clock by which sessions end."""

    def __init__(self, folder, hub: Hub | None = None) -> None:
        self.hub = hub or Hub()
        self.now = 1000.0
        self.forgotten: list[str] = []
        self.token = OperatorToken(folder / "kiosk")
        self.secret = self.token.renew()

        async def forget(capture_id: str) -> None:
            self.forgotten.append(capture_id)

        static = folder / "static"
        static.mkdir()
        (static / "operator.html").write_text("<!doctype html>")
        desk = Desk(self.hub, {"consent": True}, lambda: {"visits": 2}, forget)
        page = OperatorPage(desk, self.token, Files({"static/": static}),
                            lambda: self.now)
        self.routes = page.routes()
        self.app: App = guarded(Starlette(routes=self.routes), [ORIGIN, "https://face.example"])

    @asynccontextmanager
    async def browser(self, address: str = "127.0.0.1", origin: str = ORIGIN):
        transport = httpx2.ASGITransport(self.app, client=(address, 5000))
        async with httpx2.AsyncClient(
                transport=transport, base_url=origin, headers={"Origin": origin}) as browser:
            yield browser

    async def logged_in(self, browser: httpx2.AsyncClient) -> httpx2.AsyncClient:
        answer = await browser.post("/operator/api/login", json={"token": self.secret})
        assert answer.status_code == 200
        return browser

    def run(self, use) -> None:
        """Run what is done with a browser that has logged in."""
        async def life():
            async with self.browser() as browser:
                await use(await self.logged_in(browser))
        asyncio.run(life())
