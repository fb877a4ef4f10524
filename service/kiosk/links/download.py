"""The answer that carries a file, and knows whether all of it went out."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

__all__ = ["Download"]

_CHUNK_BYTES = 2**16
"""Sent at once; between two chunks is seen whether the file may still be sent."""
_CHUNK_S = 60.0
"""Longest time that a client may take for a chunk, seconds: a telephone at the end of the room."""


class Download(Response):
    """Sends bytes; ends the connection where they may not be sent any more.

    The scope's state has the connection as `transport`, see `service.kiosk.links.lan_server`.

    Parameters
    ----------
    wanted : whether the file may still be sent, asked before each chunk
    ended : called once, with whether the client's connection took the whole file
    """

    def __init__(
        self, content: bytes, media_type: str, headers: Mapping[str, str], *,
        wanted: Callable[[], bool], ended: Callable[[bool], Awaitable[None]],
    ) -> None:
        super().__init__(content, headers=dict(headers), media_type=media_type)
        self._wanted = wanted
        self._ended = ended

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send, unless the client leaves before the end."""
        complete = False
        leaving = asyncio.create_task(_disconnected(receive))
        try:
            complete = await self._send(send, leaving)
        finally:
            leaving.cancel()
            await asyncio.shield(self._ended(complete))
        if complete:
            await send({"type": "http.response.body", "body": b""})
        else:
            scope["state"]["transport"].abort()

    async def _send(self, send: Send, leaving: "asyncio.Task[None]") -> bool:
        """Say whether all was taken.

        What is sent waits until the socket has taken what was sent before. So the last, empty part
        is sent when nothing is left in this process.
        """
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        data = memoryview(self.body)
        for start in range(0, len(data) + _CHUNK_BYTES, _CHUNK_BYTES):
            try:
                async with asyncio.timeout(_CHUNK_S):
                    await send({"type": "http.response.body", "more_body": True,
                                "body": bytes(data[start:start + _CHUNK_BYTES])})
            except TimeoutError:
                return False
            await asyncio.sleep(0)  # what has broken off both is seen by the other task
            if leaving.done() or not self._wanted():
                return False
        return True


async def _disconnected(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
