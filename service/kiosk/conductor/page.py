"""One page: a browser's WebSocket. What it shows is sent, and nothing waits for a slow one.

Of the screens the newest counts, of the mirror the picture that was asked for, of faces the one
that is shown: each has one place, which the next takes over. A page that does not take what is sent
is closed; it comes back by itself, if it is alive.
"""

import asyncio
import json
import time
from collections.abc import Callable
from contextlib import suppress

import structlog
from pydantic import BaseModel, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from denseface.service.kiosk.page_messages import (
    FACE,
    FROM_PAGE,
    MIRROR,
    FaceHead,
    FromPage,
    Hello,
    MirrorHead,
    Screen,
)
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["Page"]

_SEND_S = 5.0
"""Longest time for a message to be taken, seconds."""
_BURST, _RATE = 120, 60.0
"""Messages of a page at once, and per second in the long run: thirty pictures and some touches."""
_UNACCEPTABLE, _REFUSED, _TRY_LATER = 1003, 1008, 1013
"""Codes of RFC 6455 and of its registry."""
_log = structlog.get_logger("kiosk")


class Page:
    """What is to be sent to one page."""

    def __init__(self, socket: WebSocket, clock: Callable[[], float] = time.monotonic) -> None:
        self._socket = socket
        self._clock = clock
        self._hello: str | None = None
        self._face: bytes | None = None
        self._screen: str | None = None
        self._mirror: bytes | None = None
        self._shown = ""
        """The screen that was sent last, or is about to be."""
        self._due = asyncio.Event()
        self._bucket = TokenBucket(_BURST, _RATE, clock())

    def show(self, screen: Screen) -> None:
        """Let it show a screen, unless it does."""
        text = screen.model_dump_json()
        if text != self._shown:
            self._shown = self._screen = text
            self._due.set()

    def show_face(self, head: FaceHead, grid: bytes) -> None:
        """Send a face: before any screen that is shown from now on."""
        self._face = _binary(FACE, head, grid)
        self._due.set()

    def show_mirror(self, head: MirrorHead, jpeg: bytes) -> None:
        """Send a picture that was asked for."""
        self._mirror = _binary(MIRROR, head, jpeg)
        self._due.set()

    def forget(self) -> None:
        """Send nothing of a visit that is over."""
        self._face = self._mirror = None

    async def serve(self, hello: Hello, heard: Callable[[FromPage], None]) -> None:
        """Send and listen until either side ends."""
        self._hello = hello.model_dump_json()
        self._due.set()
        both = [asyncio.create_task(self._write()), asyncio.create_task(self._read(heard))]
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            for error in await asyncio.gather(*both, return_exceptions=True):
                if isinstance(error, Exception) and not isinstance(error, _ENDS):
                    raise error

    async def _write(self) -> None:
        while True:
            await self._due.wait()
            self._due.clear()
            while (message := self._next()) is not None:
                try:
                    async with asyncio.timeout(_SEND_S):
                        if isinstance(message, str):
                            await self._socket.send_text(message)
                        else:
                            await self._socket.send_bytes(message)
                except TimeoutError:
                    _log.warning("page closed", reason="it does not take what is sent to it")
                    return

    def _next(self) -> str | bytes | None:
        """Give what is to be sent next: a face before the screen that shows it."""
        for name in ("_hello", "_face", "_screen", "_mirror"):
            message: str | bytes | None = getattr(self, name)
            if message is not None:
                setattr(self, name, None)
                return message
        return None

    async def _read(self, heard: Callable[[FromPage], None]) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] != "websocket.receive":
                return
            text = message.get("text")
            if text is None:
                await self._close(_UNACCEPTABLE, "it sent bytes")
                return
            if not self._bucket.take(self._clock()):
                await self._close(_REFUSED, "it says too much")
                return
            try:
                said = FROM_PAGE.validate_json(text)
            except ValidationError:
                await self._close(_REFUSED, "what it said is malformed")
                return
            heard(said)

    async def _close(self, code: int, reason: str) -> None:
        _log.warning("page closed", reason=reason)
        with suppress(*_ENDS):
            await self._socket.close(code)


_ENDS = (WebSocketDisconnect, RuntimeError, OSError)
"""What a socket raises that was closed meanwhile."""


def _binary(kind: int, head: BaseModel, payload: bytes) -> bytes:
    text = json.dumps(head.model_dump(mode="json"), separators=(",", ":")).encode()
    return b"".join([bytes([kind]), len(text).to_bytes(4, "little"), text, payload])
