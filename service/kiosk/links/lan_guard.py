"""Who may ask at the LAN door, and how often."""

import time
from collections.abc import Callable, Iterable
from http import HTTPStatus

from denseface.service.kiosk.links.lan_server import client_of
from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send, header_values, refuse
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["LanGuard"]

_METHODS = ("GET", "HEAD")
_BURST, _RATE = 60.0, 2.0
"""Requests of one client at once, and a second in the long run: a room may share an address."""
_MAX_CLIENTS = 4096
_HOSTS_S = 5.0
"""Time for which the names of this machine are taken to stay as they are, seconds."""
_RETRY_AFTER_S = 5


class LanGuard:
    """Lets through what asks by a name of this machine, reads, and does not ask too often.

    Parameters
    ----------
    hosts : gives the names, with ports
    clock : seconds
    """

    def __init__(
        self, app: App, hosts: Callable[[], Iterable[str]],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._hosts = hosts
        self._clock = clock
        self._known: frozenset[str] = frozenset()
        self._known_until = -1.0
        self._clients: BoundedDict[str, TokenBucket] = BoundedDict(_MAX_CLIENTS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through, or refuse with one line; each connection is for one request."""
        if scope["type"] != "http":
            return
        if not self._has_room(scope):
            await refuse(scope, send, HTTPStatus.TOO_MANY_REQUESTS, "too many requests",
                         [(b"retry-after", str(_RETRY_AFTER_S).encode())])
        elif not self._is_known(header_values(scope, b"host")):
            await refuse(scope, send, HTTPStatus.NOT_FOUND, "there is nothing here")
        elif scope["method"] not in _METHODS:
            await refuse(scope, send, HTTPStatus.METHOD_NOT_ALLOWED, "expected GET",
                         [(b"allow", ", ".join(_METHODS).encode())])
        else:
            await self._app(scope, receive, send)

    def _has_room(self, scope: Scope) -> bool:
        now = self._clock()
        client = client_of(scope["client"][0] if scope["client"] else "")
        return self._clients.setdefault(client, TokenBucket(_BURST, _RATE, now)).take(now)

    def _is_known(self, hosts: list[str]) -> bool:
        now = self._clock()
        if now > self._known_until:
            self._known = frozenset(self._hosts())
            self._known_until = now + _HOSTS_S
        return len(hosts) == 1 and hosts[0].lower() in self._known
