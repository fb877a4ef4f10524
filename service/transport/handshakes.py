"""Handshakes that fail: garbage, other mechanisms, wrong keys, silence.

libzmq closes such connections by itself and reports it on the socket's monitor.
"""

import errno
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

import zmq

from denseface.service.monitoring import Rejections
from denseface.service.transport.sockets import Socket, open_monitor

_E = zmq.Event
_EVENTS = (_E.ACCEPTED | _E.DISCONNECTED | _E.CLOSED | _E.HANDSHAKE_SUCCEEDED
           | _E.HANDSHAKE_FAILED_AUTH | _E.HANDSHAKE_FAILED_PROTOCOL
           | _E.HANDSHAKE_FAILED_NO_DETAIL)
_EVENT = struct.Struct("=Hi")
"""Event and value, as libzmq's monitor sends them."""
_MAX_EVENTS = 2000
"""Events read at a time, in some 20 ms."""
_MAX_BEHIND = 100
"""Times in a row that there may be more events than are read: 50 MB of them."""
_DETAILS = {
    zmq.PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC: "made for another hub key",
    zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH: "not the CURVE mechanism",
    errno.EAGAIN: "too slow",
    errno.EPIPE: "broken off",
}


class Connections(Protocol):
    """Is told of the connections of one bound socket, by their descriptors."""

    def opened(self, descriptor: int) -> None:
        """Note a new connection."""

    def closed(self, descriptor: int) -> None:
        """Note that a connection closed."""

    def all_closed(self) -> None:
        """Note that all connections were closed."""

    def has_spoken(self, descriptor: int) -> bool:
        """Say whether an allowed key has said something by a connection."""


class HandshakeMonitor:
    """Counts the failed handshakes of one bound socket, and tells `connections` who is there.

    Where `rejections` is None, it counts nothing: nobody needs a handshake there.
    """

    def __init__(
        self, listening: Socket, rejections: Rejections | None, connections: Connections
    ) -> None:
        self._rejections = rejections
        self._listening = listening
        self._connections = connections
        self.socket = open_monitor(listening, int(_EVENTS))
        self._behind = 0
        """Times in a row that more had happened than is read at a time."""
        self._accepted: dict[int, float] = {}
        """Descriptor -> when the connection was accepted, monotonic seconds, of those open."""
        self._open: dict[int, str] = {}
        """Descriptor -> address of connections whose handshake is not over."""
        self._failed: str | None = None
        """Why the handshake of the connection that is closed next failed."""
        self._refused = 0
        """Connections refused by the authenticator, which has counted them, and not yet closed."""

    def read(self) -> None:
        """Read and count what happened, of a flood a part."""
        for _ in range(_MAX_EVENTS):
            try:
                event, _ = self.socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                self._behind = 0
                return
            self._note(*_EVENT.unpack(event))
        self._behind += 1

    @property
    def behind(self) -> bool:
        """More had happened at the last look than was read."""
        return self._behind > 0

    @property
    def flooded(self) -> bool:
        """More has happened for long than can be read: the socket is to be cut."""
        return self._behind > _MAX_BEHIND

    def forget(self) -> None:
        """Forget all connections: they were cut, which libzmq does not report.

        To be called when the socket is unbound, so that what is to be read has an end.
        """
        self.read()
        while self.behind:
            self.read()
        self._all_closed()

    def silent(self, for_s: float) -> list[int]:
        """Give the descriptors of connections that have said nothing for a time, oldest first."""
        before = time.monotonic() - for_s
        return [descriptor for descriptor, since in self._accepted.items()
                if since <= before and not self._connections.has_spoken(descriptor)]

    def close(self) -> None:
        """Stop reading."""
        self._listening.disable_monitor()
        self.socket.close(linger=0)

    def _all_closed(self) -> None:
        self._open.clear()
        self._accepted.clear()
        self._connections.all_closed()

    def _note(self, event: int, value: int) -> None:
        if event == _E.ACCEPTED:
            self._accepted.pop(value, None)
            self._accepted[value] = time.monotonic()
            self._connections.opened(value)
            self._open[value] = address_of(value)
        elif event == _E.CLOSED:  # the listener, and all its connections with it
            self._all_closed()
        elif event == _E.HANDSHAKE_SUCCEEDED:
            # Of several at once it does not say which: another address may be named later.
            if self._open:
                self._open.popitem()
        elif event == _E.HANDSHAKE_FAILED_AUTH:
            self._refused += 1
        elif event == _E.DISCONNECTED:
            self._accepted.pop(value, None)
            self._connections.closed(value)
            self._ended(self._open.pop(value, None))
        elif value == errno.EFAULT:  # libzmq refuses the connection
            self._reject(None, "no authenticator")
        else:
            self._failed = _DETAILS.get(value, f"{value:#x}")

    def _ended(self, address: str | None) -> None:
        failed, self._failed = self._failed, None
        if failed:
            self._reject(address, failed)
        elif address and self._refused:
            self._refused -= 1
        elif address:
            self._reject(address, "not ZeroMQ, or broken off")

    def _reject(self, address: str | None, detail: str) -> None:
        if self._rejections:
            self._rejections.note("handshake", address=address, detail=detail)


def address_of(descriptor: int) -> str:
    """Give the address at the other end of a connection, "gone" where it is closed.

    The descriptor may be another file's by now, or that of a socket of another kind.
    """
    with suppress(OSError), connection_of(descriptor) as connection:
        name = connection.getpeername()
        if isinstance(name, tuple):  # of the Internet: the descriptor may be another's meanwhile
            return f"{name[0]}:{name[1]}"
    return "gone"


def end_connection(descriptor: int) -> bool:
    """End one connection of libzmq's, which itself can only end all of a socket.

    libzmq finds that the other end has gone. False where there is no connection.
    """
    with suppress(OSError), connection_of(descriptor) as connection:
        if not connection.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
            connection.shutdown(socket.SHUT_RDWR)
            return True
    return False


@contextmanager
def connection_of(descriptor: int) -> Iterator[socket.socket]:
    """Give a connection of libzmq's as a socket; OSError where there is none.

    It takes no descriptor of its own: there may be none left.
    """
    connection = socket.socket(fileno=descriptor)
    try:
        yield connection
    finally:
        connection.detach()
