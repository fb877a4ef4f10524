"""Who is at the other end of a connection within this machine: the user who looks, nobody else.

The page's path is secret, but a browser that is started with it shows it in the list of processes,
to every user of the machine. Linux says of each socket whose it is (proc(5), /proc/net/tcp).
"""

import os
import socket
import sys
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path

from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send, refuse

__all__ = ["OwnUser", "user_of"]

_TABLES = {socket.AF_INET: Path("/proc/net/tcp"), socket.AF_INET6: Path("/proc/net/tcp6")}
_LOCAL, _REMOTE, _USER = 1, 2, 7
"""Columns of these tables."""
_WORD_BYTES = 4
"""Addresses are written as words of the machine's own order of bytes."""


class OwnUser:
    """Lets through the user of this process, and root; others where the system does not say."""

    def __init__(self, app: App) -> None:
        self._app = app
        self._known = frozenset({os.getuid(), 0})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through, or refuse with one line."""
        client, server = scope.get("client"), scope.get("server")
        user = user_of(tuple(client), tuple(server)) if client and server else None
        if user is None or user in self._known:
            await self._app(scope, receive, send)
        else:
            await refuse(scope, send, HTTPStatus.FORBIDDEN, "this page is another user's")


def user_of(local: tuple[str, int], remote: tuple[str, int]) -> int | None:
    """Give the number of the user whose socket is bound to an address and connected to another.

    None where the system does not say.
    """
    try:
        family = socket.AF_INET6 if ip_address(local[0]).version == 6 else socket.AF_INET
        wanted = _written(*local, family), _written(*remote, family)
        with _TABLES[family].open() as table:
            for line in table:
                columns = line.split()
                if tuple(columns[_LOCAL:_REMOTE + 1]) == wanted:
                    return int(columns[_USER])
    except (OSError, ValueError, IndexError):
        return None
    return None


def _written(host: str, port: int, family: socket.AddressFamily) -> str:
    packed = socket.inet_pton(family, host)
    words = [packed[at:at + _WORD_BYTES] for at in range(0, len(packed), _WORD_BYTES)]
    if sys.byteorder == "little":
        words = [word[::-1] for word in words]
    return f"{b''.join(words).hex().upper()}:{port:04X}"
