"""A socket that the hub binds, with CURVE where others can reach it."""

from dataclasses import dataclass
from pathlib import Path

import zmq

from denseface.service.errors import AddressError, ServiceError
from denseface.service.monitoring import Rejections
from denseface.service.security import AllowList, KeyPair
from denseface.service.transport.addresses import check_socket_file
from denseface.service.transport.handshakes import (
    Connections,
    HandshakeMonitor,
    end_connection,
)
from denseface.service.transport.sockets import Socket

_HANDSHAKE_MS = 10_000
"""Longest time for a handshake, milliseconds; then libzmq closes the connection."""
_SILENT_S = 20.0
"""Time after which a connection by which nothing was said counts as silent, seconds: its handshake
is over."""
_MAX_SILENT = 64
"""Connections that may stay open though nobody has said anything by them: clients in waiting."""


@dataclass(frozen=True)
class ServerCredentials:
    """The hub's own key pair, and whose keys it accepts."""

    pair: KeyPair
    allow_list: AllowList


class BoundSocket:
    """Binds a socket, ends connections of it, cuts all of them and binds it again.

    By its ZAP domain the authenticator knows it; without credentials anybody may connect.
    """

    def __init__(
        self, socket: Socket, address: str, domain: bytes, credentials: ServerCredentials | None,
        rejections: Rejections, connections: Connections,
    ) -> None:
        self.socket = socket
        self.bound = False
        self._address = address
        self._file = (
            Path(address.removeprefix("ipc://")) if address.startswith("ipc://") else None)
        self._inode: tuple[int, int] | None = None
        """Of the file that was bound."""
        socket.set(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
        if credentials:
            socket.set(zmq.CURVE_SERVER, 1)
            socket.set(zmq.CURVE_SECRETKEY, credentials.pair.secret.encode())
            socket.set(zmq.ZAP_ENFORCE_DOMAIN, 1)
            socket.set(zmq.ZAP_DOMAIN, domain)
        self.monitor = HandshakeMonitor(socket, rejections if credentials else None, connections)
        """Tells `connections`, and with credentials counts failed handshakes."""

    def bind(self) -> None:
        """Bind, also after `cut`; AddressError where the address cannot be had."""
        if self.bound:
            return
        self._bind()
        # With its name resolved, so that binding again asks nobody.
        self._address = self.socket.get_string(zmq.LAST_ENDPOINT).rstrip("\0")
        self.bound = True

    def has_its_file(self) -> bool:
        """Say whether the socket's file, if it has one, is the one that was bound."""
        return self._file is None or _inode_of(self._file) == self._inode

    def restore_file(self) -> str | None:
        """Bind once more where the file is not the one that was bound; give why that fails.

        The connections that there are go on: a file is only where new ones come in.
        """
        if self._file is None or self.has_its_file():
            return None
        try:
            check_socket_file(self._file)  # libzmq would take another hub's place
            self._bind()
        except ServiceError as error:
            return str(error)
        return None

    def _bind(self) -> None:
        try:
            self.socket.bind(self._address)
        except zmq.ZMQError as error:
            raise AddressError(f"{self._address}: {zmq.strerror(error.errno or 0)}") from error
        if self._file:
            self._inode = _inode_of(self._file)

    def cut(self) -> None:
        """End all connections, also those of which nothing is known yet.

        Those that are allowed come back by themselves within a second of the next `bind`, pass the
        authenticator again and fetch what they missed.
        """
        if self.bound:
            self.socket.unbind(self._address)
            self.bound = False
        self.monitor.forget()

    def end_silent(self) -> None:
        """End all connections by which nothing was said."""
        self.monitor.read()
        for descriptor in self.monitor.silent(0.0):
            end_connection(descriptor)

    def limit_silent(self) -> None:
        """End the oldest connections that say nothing, where they are many."""
        for descriptor in self.monitor.silent(_SILENT_S)[:-_MAX_SILENT]:
            end_connection(descriptor)

    def close(self) -> None:
        """Close the socket, its monitor before it, and leave no file of its own behind."""
        self.monitor.close()
        self.socket.close()
        if self._file and self._inode and self.has_its_file():
            self._file.unlink(missing_ok=True)


def _inode_of(file: Path) -> tuple[int, int] | None:
    try:
        found = file.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
