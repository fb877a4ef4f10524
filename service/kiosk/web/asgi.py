"""What an ASGI application is, and short answers of one's own."""

from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from http import HTTPStatus
from typing import Any

__all__ = ["App", "Receive", "Scope", "Send", "header_values", "refuse"]

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]


def header_values(scope: Scope, name: bytes) -> list[str]:
    """Give all values of a header; its name in lower case, as servers give it."""
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]


async def refuse(
    scope: Scope, send: Send, status: HTTPStatus, why: str,
    headers: Iterable[tuple[bytes, bytes]] = (),
) -> None:
    """Answer with one line; a WebSocket is not accepted, which the server answers with 403."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": ""})
        return
    body = f"{why}\n".encode()
    await send({"type": "http.response.start", "status": int(status), "headers": [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()), (b"connection", b"close"), *headers]})
    await send({"type": "http.response.body", "body": body})
