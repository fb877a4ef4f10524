"""The visitor's page with no service behind it: every screen with example data, at any size.

`python -m tests.kiosk_states` serves the built page and says where; `/show/NAME` shows a state.
The page itself is the real one: its bundle, its languages, its socket.
"""

import asyncio
import functools
import json
import socket
import struct
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import segno
import uvicorn
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.websockets import WebSocket, WebSocketDisconnect

from denseface.capture.source import open_source
from denseface.service.daemons.preview_picture import preview_jpeg
from denseface.service.kiosk.installed import STATIC
from denseface.service.kiosk.page_messages import FACE, FROM_PAGE, MIRROR, Hello, Screen
from denseface.service.kiosk.web.app import kiosk_app, kiosk_files
from denseface.service.kiosk.web.asgi import App
from denseface.service.kiosk.web.guard import origins_of
from tests.waiting import LIMIT_S, until

ROOT = Path(__file__).resolve().parents[1]
VECTORS = ROOT / "service/kiosk/frontend/test/vectors"
LANGUAGES = ("en", "de", "fr", "es", "zh", "ar")

_ID = "example-1"
_RESULT = {"capture_id": _ID, "initial_points": 14822, "dense_points": 148222, "can_keep": True}
_MEASURED = [
    {"name": name, "value_mm": value, "low_mm": value - 1.2, "high_mm": value + 1.2}
    for name, value in (("face_width", 138.4), ("face_length", 118.9), ("nose_width", 36.2),
                        ("nose_length", 49.7), ("eye_distance", 62.8))]
_PAGE = "https://192.168.1.20:8443/d/mKf3vZ0pQx7RwT1uYb9LdA"
_QR = ["".join(map(str, row)) for row in segno.make(_PAGE, error="m").matrix]
_KEPT = {"page": _PAGE, "qr": _QR, "uses": 5,
         "expires_s": 1800.0, "links": [
             {"format": form, "url": f"{_PAGE}/face.{form}"}
             for form in ("glb", "ply", "stl", "png")]}


def _position(**said: Any) -> dict[str, Any]:
    return {"name": "position", "position": said}


STATES: dict[str, dict[str, Any]] = {
    "attract": {"name": "attract"},
    "consent": {"name": "consent", "consent": {
        "retention_s": 86400.0, "text_version": "built-in-1", "links": True}},
    "consent_forever": {"name": "consent", "consent": {
        "retention_s": None, "text_version": "built-in-1", "links": True}},
    "consent_own": {"name": "consent", "consent": {
        "retention_s": 3600.0, "text_version": "museum-3",
        "text": {"en": ["The museum takes one picture of your face to show it to you.",
                        "It is deleted after one hour."]}}},
    "position_first": _position(),
    **{f"position_{arrow}": _position(hint=hint, arrow=arrow) for arrow, hint in (
        ("left", "move_left"), ("right", "move_right"), ("up", "move_up"), ("down", "move_down"),
        ("closer", "come_closer"), ("back", "move_back"))},
    "position_light": _position(hint="more_light", can_press=False),
    "position_uncover": _position(hint="uncover", can_press=True, with_warnings=True),
    "position_well": _position(progress=0.6, can_press=True),
    "countdown": {"name": "countdown", "countdown": {"left": 3}},
    "countdown_0": {"name": "countdown", "countdown": {"left": 0}},
    "captured": {"name": "captured"},
    "reconstructing": {"name": "reconstructing"},
    "result": {"name": "result", "result": _RESULT},
    "result_unlinked": {"name": "result", "result": {**_RESULT, "no_links": True}},
    "result_measured": {"name": "result", "result": {
        **_RESULT, "warnings": ["more_light"], "measurements": _MEASURED}},
    "keep": {"name": "keep", "result": _RESULT, "keep": _KEPT},
    "deleting": {"name": "deleting"},
    "failed": {"name": "failed", "failed": {"why": "no_face", "hint": "come_closer"}},
    "failed_busy": {"name": "failed", "failed": {"why": "busy"}},
    "thanks_deleted": {"name": "thanks", "thanks": {"deleted": True}},
    "thanks_kept": {"name": "thanks", "thanks": {"deleted": False, "retention_s": 86400.0}},
    "thanks_nothing": {"name": "thanks", "thanks": {"deleted": None}},
    "busy": {"name": "busy"},
    "leaving": {"name": "result", "result": _RESULT, "leaving_s": 9.0},
    **{f"trouble_{gone}": {"name": name, "trouble": gone} for gone, name in (
        ("sensor", "position"), ("worker", "reconstructing"), ("hub", "attract"),
        ("disk", "attract"))},
    "trouble_result": {"name": "result", "result": _RESULT, "trouble": "sensor"},
}
"""What is said of each screen, by a name for the picture's file."""


class States:
    """A server that shows one state to every page, and keeps what the pages say."""

    def __init__(self, **hello: Any) -> None:
        self.said: list[Any] = []
        """What the pages said, checked; oldest first."""
        self.away = False
        """Whether pages that come are sent away."""
        self.hello = Hello(**{"languages": LANGUAGES, "version": "1", **hello})
        self._screen = Screen(visit=1, name="attract")  # type: ignore[arg-type]
        self._pages: set[WebSocket] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.url = ""
        self.face = next(path for path in (
            STATIC / "sample.face", VECTORS / "dome.face") if path.exists())
        self.picture = _picture()

    def show(self, name: str, visit: int = 1, **changes: Any) -> None:
        """Show a state on every page; callable from any thread."""
        said = STATES[name]
        screen = Screen.model_validate({"visit": visit, **said, **changes})
        assert self._loop is not None
        asyncio.run_coroutine_threadsafe(self._show(screen), self._loop).result(LIMIT_S)

    def drop(self) -> None:
        """Close every page's connection."""
        assert self._loop is not None
        asyncio.run_coroutine_threadsafe(self._drop(), self._loop).result(LIMIT_S)

    async def _drop(self) -> None:
        for page in list(self._pages):
            await page.close(1012)

    async def _show(self, screen: Screen) -> None:
        self._screen = screen
        for page in list(self._pages):
            await self._send(page)

    async def _send(self, page: WebSocket) -> None:
        if self._screen.result is not None:
            head = {"capture_id": self._screen.result.capture_id, "visit": self._screen.visit}
            await page.send_bytes(_binary(FACE, head, self.face.read_bytes()))
        await page.send_text(self._screen.model_dump_json())

    async def talk(self, page: WebSocket) -> None:
        """Serve one page."""
        await page.accept()
        if self.away:
            await page.close(1013)
            return
        await page.send_text(self.hello.model_dump_json())
        self._pages.add(page)
        await self._send(page)
        try:
            while True:
                said = FROM_PAGE.validate_json(await page.receive_text())
                if said.kind == "next":
                    await asyncio.sleep(0.03)
                    head = {"timestamp_us": len(self.said), "width": 320, "height": 240}
                    await page.send_bytes(_binary(MIRROR, head, self.picture))
                else:
                    self.said.append(said)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages.discard(page)

    def app(self, port: int) -> App:
        """Give what a kiosk serves, behind its own guards."""

        async def show(request: Request) -> Response:
            said = STATES[request.path_params["name"]]
            await self._show(Screen.model_validate({"visit": 1, **said}))
            return PlainTextResponse(json.dumps(said))

        return kiosk_app(self.talk, origins_of("http", "127.0.0.1", port), kiosk_files(),
                         [Route("/show/{name}", show)])

    async def serve(self, server: uvicorn.Server, bound: socket.socket) -> None:
        """Serve until the server is told to exit."""
        self._loop = asyncio.get_running_loop()
        await server.serve(sockets=[bound])


@functools.cache
def _picture() -> bytes:
    with open_source(str(ROOT / "fixtures/recorded_oni/frontal_700.oni")) as source:
        return preview_jpeg(next(iter(source)))


def _binary(kind: int, head: dict[str, Any], payload: bytes) -> bytes:
    said = json.dumps(head).encode()
    return struct.pack("<BI", kind, len(said)) + said + payload


@contextmanager
def serving(port: int = 0, **hello: Any) -> Iterator[States]:
    """Serve the page on a free port of the loopback; yield what steers it."""
    states, bound = States(**hello), socket.create_server(("127.0.0.1", port))
    port = bound.getsockname()[1]
    states.url = f"http://127.0.0.1:{port}/"
    server = uvicorn.Server(uvicorn.Config(
        states.app(port), log_level="warning", ws="websockets-sansio"))
    thread = threading.Thread(target=lambda: asyncio.run(states.serve(server, bound)))
    thread.start()
    try:
        until(lambda: server.started or not thread.is_alive())
        yield states
    finally:
        server.should_exit = True
        thread.join(LIMIT_S)
        bound.close()


if __name__ == "__main__":
    with serving(int(sys.argv[1]) if len(sys.argv) > 1 else 0) as running:
        sys.stdout.write(f"{running.url}\n{running.url}show/NAME: {' '.join(STATES)}\n")
        sys.stdout.flush()
        threading.Event().wait()
