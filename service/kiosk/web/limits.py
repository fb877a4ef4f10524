"""How much one may ask: requests a second of each address, bytes of a request's head and body."""

import time
from collections.abc import Callable, MutableMapping
from http import HTTPStatus
from typing import Any

from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send, header_values, refuse
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["MAX_BODY_BYTES", "Limits"]

MAX_BODY_BYTES = 16 * 1024
"""Longest body of a request: forms of the operator's page are much shorter."""
_MAX_HEADERS = 64
_MAX_HEADER_BYTES = 16 * 1024
"""Of a request, names and values: browsers send a twentieth."""
_MAX_TARGET_BYTES = 1024
"""Longest path with its query."""
_BURST = 200
"""Requests of one address at once: a page with all its files is about twenty."""
_RATE = 50.0
"""Requests of one address in the long run, per second."""
_ADDRESSES = 1000
"""Addresses that are counted."""


class Limits:
    """Answers 429 to who asks too often, 413 or 431 to who says too much.

    Parameters
    ----------
    app : what is protected
    clock : seconds
    """

    def __init__(self, app: App, clock: Callable[[], float] = time.monotonic) -> None:
        self._app = app
        self._clock = clock
        self._buckets: BoundedDict[str, TokenBucket] = BoundedDict(_ADDRESSES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse with one line."""
        if not self._may_ask(scope):
            await refuse(scope, send, HTTPStatus.TOO_MANY_REQUESTS, "too many requests",
                         [(b"retry-after", b"1")])
            return
        headers = scope["headers"]
        if len(headers) > _MAX_HEADERS or (
                sum(len(name) + len(value) for name, value in headers) > _MAX_HEADER_BYTES) or (
                len(scope["raw_path"]) + len(scope["query_string"]) > _MAX_TARGET_BYTES):
            await refuse(scope, send, HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "too long")
            return
        lengths = header_values(scope, b"content-length")
        if any(not (length.isdecimal() and int(length) <= MAX_BODY_BYTES) for length in lengths):
            await refuse(scope, send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "too long")
            return
        await self._app(scope, _Bounded(receive), send)

    def _may_ask(self, scope: Scope) -> bool:
        address = str((scope.get("client") or ("",))[0])
        now = self._clock()
        return self._buckets.setdefault(address, TokenBucket(_BURST, _RATE, now)).take(now)


class _Bounded:
    """What is received, until a request's body is too long: then its sender is gone."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._left = MAX_BODY_BYTES

    async def __call__(self) -> MutableMapping[str, Any]:
        message = await self._receive()
        if message["type"] == "http.request":
            self._left -= len(message.get("body", b""))
            if self._left < 0:
                return {"type": "http.disconnect"}
        return message
