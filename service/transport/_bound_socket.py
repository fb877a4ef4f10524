"""A socket that the hub binds, with CURVE where others can reach it."""

from dataclasses import dataclass

import zmq

from denseface.service.errors import AddressError
from denseface.service.monitoring import Rejections
from denseface.service.security import AllowList, KeyPair
from denseface.service.transport.handshakes import Connections, HandshakeMonitor
from denseface.service.transport.sockets import Socket

_HANDSHAKE_MS = 10_000
"""Longest time for a handshake, milliseconds; then libzmq closes the connection."""


@dataclass(frozen=True)
class ServerCredentials:
    """The hub's own key pair, and whose keys it accepts."""

    pair: KeyPair
    allow_list: AllowList


class BoundSocket:
    """Binds a socket, cuts all its connections and binds it again.

    By its ZAP domain the authenticator knows it; without credentials anybody may connect.
    """

    def __init__(
        self, socket: Socket, address: str, domain: bytes, credentials: ServerCredentials | None,
        rejections: Rejections, connections: Connections | None,
    ) -> None:
        self.socket = socket
        self.monitor: HandshakeMonitor | None = None
        """Tells `connections`, and with credentials counts failed handshakes."""
        self.bound = False
        self._address = address
        if credentials:
            socket.set(zmq.CURVE_SERVER, 1)
            socket.set(zmq.CURVE_SECRETKEY, credentials.pair.secret.encode())
            socket.set(zmq.ZAP_ENFORCE_DOMAIN, 1)
            socket.set(zmq.ZAP_DOMAIN, domain)
            socket.set(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
        if connections:
            self.monitor = HandshakeMonitor(
                socket, rejections if credentials else None, connections)

    def bind(self) -> None:
        """Bind, also after `cut`; AddressError where the address cannot be had."""
        if self.bound:
            return
        try:
            self.socket.bind(self._address)
        except zmq.ZMQError as error:
            raise AddressError(f"{self._address}: {zmq.strerror(error.errno or 0)}") from error
        # With its name resolved, so that binding again asks nobody.
        self._address = self.socket.get_string(zmq.LAST_ENDPOINT).rstrip("\0")
        self.bound = True

    def cut(self) -> None:
        """End all connections, as one alone cannot be ended.

        Those that are allowed come back by themselves within a second of the next `bind`, pass the
        authenticator again and fetch what they missed.
        """
        if self.bound:
            self.socket.unbind(self._address)
            self.bound = False
        if self.monitor:
            self.monitor.forget()

    def close(self) -> None:
        """Close the socket, and its monitor before it."""
        if self.monitor:
            self.monitor.close()
        self.socket.close()
