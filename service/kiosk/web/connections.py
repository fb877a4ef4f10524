"""Connections that are bounded: how many there are, how long each may take to ask and to listen."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

__all__ = ["MAX_CONNECTIONS", "MAX_MESSAGE_BYTES", "BoundedHttp", "BoundedWebSocket"]

MAX_CONNECTIONS = 128
"""Connections at a time; a further one is closed at once."""
MAX_MESSAGE_BYTES = 4096
"""Longest message of a page, in whatever fragments."""
_MAX_FRAGMENTS = 64
"""Most fragments of a message: browsers send one."""
_MAX_UNTAKEN_BYTES = 8 * 2**20
"""Most that waits to be taken, eight faces: answers to pings are not counted elsewhere."""
_ASK_S = 10.0
"""Longest time from the connection, or the last answer, to the end of a request, seconds."""
_ANSWER_S = 120.0
"""Longest time for an answer to be taken, seconds: a file of some megabytes by poor radio."""
_LINGER_S = 2.0
"""Longest time for what was said last to be taken, seconds."""


class BoundedHttp(H11Protocol):
    """Cuts off who does not ask in time, and who does not listen."""

    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, where there is room."""
        if len(self.connections) >= MAX_CONNECTIONS:
            transport.abort()
            return
        super().connection_made(transport)
        self._wait(_ASK_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stop_waiting()
        if self.transport is not None:
            super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what comes; of a connection that was refused, nothing."""
        if self.transport is None:
            return
        super().data_received(data)
        if self.transport.get_protocol() is not self:
            self._stop_waiting()  # it is a WebSocket now
        elif self.cycle is not None and not self.cycle.response_complete and (
                not self.cycle.more_body):
            self._wait(_ANSWER_S)

    def on_response_complete(self) -> None:
        """Wait for the next request, or until what was said is taken."""
        self._wait(_ANSWER_S if self.transport.get_write_buffer_size() else _ASK_S)
        super().on_response_complete()

    def _wait(self, seconds: float) -> None:
        self._stop_waiting()
        self._due = self.loop.call_later(seconds, self.transport.abort)

    def _stop_waiting(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None


class BoundedWebSocket(WebSocketsSansIOProtocol):
    """Ends a connection for good when its application is through with it, or it is abused."""

    def data_received(self, data: bytes) -> None:
        """Take what comes, unless the other side lets all that it is answered lie."""
        if self.transport.get_write_buffer_size() > _MAX_UNTAKEN_BYTES:
            self.transport.abort()
            return
        super().data_received(data)

    def handle_cont(self, event: Frame) -> None:
        """Take a further fragment; empty ones have no length that would end it."""
        if len(self.frames) >= _MAX_FRAGMENTS:
            self.transport.abort()
            return
        super().handle_cont(event)

    def on_task_complete(self, task: "asyncio.Task[Any]") -> None:
        """Cut it off where the other side does not take what was said last."""
        super().on_task_complete(task)
        self.loop.call_later(_LINGER_S, self.transport.abort)
