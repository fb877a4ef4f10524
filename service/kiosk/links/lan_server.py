"""The connections of the LAN door, and limits on those who open them: anybody in the room."""

import asyncio
import socket
from collections import Counter
from ipaddress import IPv6Address, ip_address, ip_network
from typing import Any

from denseface.service.kiosk.web.connections import BoundedHttp

__all__ = ["BoundedListener", "LanConnection", "client_of"]

_MAX_CONNECTIONS, _MAX_OF_CLIENT = 64, 12
"""At once: in all, and of one client. A browser opens six."""
_SEND_BUFFER_BYTES = 2**16
"""Of a connection in the kernel: what a client has not taken is seen to be left, but for this."""
_HOST_BITS_V6 = 64
"""Last bits of an IPv6 address: a telephone chooses them anew whenever it likes."""


class BoundedListener(socket.socket):
    """Accepts a client's share of connections and closes the others, before TLS is spoken.

    Parameters
    ----------
    bound : a socket that listens, which this one replaces
    """

    def __init__(self, bound: socket.socket) -> None:
        super().__init__(bound.family, bound.type, bound.proto, fileno=bound.detach())
        self.setblocking(False)
        self.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        self._clients: Counter[str] = Counter()

    def accept(self) -> tuple[socket.socket, Any]:
        """Give the next connection that there is room for; raises as `socket.accept`."""
        while True:
            connection, address = super().accept()
            client = client_of(address[0])
            if (self._clients.total() < _MAX_CONNECTIONS
                    and self._clients[client] < _MAX_OF_CLIENT):
                return _Counted(connection, client, self._clients), address
            connection.close()


class _Counted(socket.socket):
    """A connection that counts until it is closed."""

    def __init__(self, accepted: socket.socket, client: str, clients: Counter[str]) -> None:
        super().__init__(accepted.family, accepted.type, accepted.proto, fileno=accepted.detach())
        self._client = client
        self._clients = clients
        clients[client] += 1

    def close(self) -> None:
        """Make room for another."""
        if self.fileno() != -1:
            self._clients[self._client] -= 1
            if not self._clients[self._client]:
                del self._clients[self._client]
        super().close()


class LanConnection(BoundedHttp):
    """Sends only once what was sent before is taken.

    The application has the transport in its scope's state.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=1, low=0)
        self.app_state = {**self.app_state, "transport": transport}


def client_of(address: str) -> str:
    """Give what stands for a client: an IPv4 address, or a network of IPv6."""
    try:
        found = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if not isinstance(found, IPv6Address):
        return str(found)
    if found.ipv4_mapped:
        return str(found.ipv4_mapped)
    return str(ip_network((int(found), 128 - _HOST_BITS_V6), strict=False))
