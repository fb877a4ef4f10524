"""Handshakes that fail: garbage, other mechanisms, wrong keys, silence.

libzmq closes such connections by itself and reports it on the socket's monitor.
"""

import errno
import os
import socket
from contextlib import suppress

import zmq
from zmq.utils.monitor import recv_monitor_message

from denseface.service.monitoring import Rejections
from denseface.service.transport._routing_ids import RoutingIds
from denseface.service.transport.sockets import Socket, open_monitor

_E = zmq.Event
_EVENTS = (_E.ACCEPTED | _E.DISCONNECTED | _E.HANDSHAKE_SUCCEEDED | _E.HANDSHAKE_FAILED_AUTH
           | _E.HANDSHAKE_FAILED_PROTOCOL | _E.HANDSHAKE_FAILED_NO_DETAIL)
_DETAILS = {
    zmq.PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC: "made for another hub key",
    zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH: "not the CURVE mechanism",
    errno.EAGAIN: "too slow",
    errno.EPIPE: "broken off",
}


class HandshakeMonitor:
    """Counts the failed handshakes of one bound socket, and tells `routing_ids` who is there."""

    def __init__(self, listening: Socket, rejections: Rejections) -> None:
        self._rejections = rejections
        self._listening = listening
        self.routing_ids = RoutingIds()
        self.socket = open_monitor(listening, int(_EVENTS))
        self._open: dict[int, str] = {}
        """Descriptor -> address of connections whose handshake is not over."""
        self._failed: str | None = None
        """Why the handshake of the connection that is closed next failed."""
        self._refused = 0
        """Connections refused by the authenticator, which has counted them, and not yet closed."""

    def read(self) -> None:
        """Read and count what happened."""
        while True:
            try:
                event = recv_monitor_message(self.socket, zmq.DONTWAIT)
            except zmq.Again:
                return
            self._note(zmq.Event(event["event"]), event["value"])

    def forget(self) -> None:
        """Forget the open handshakes: all connections were cut, which libzmq does not report."""
        self.read()
        self._open.clear()
        self.routing_ids.all_closed()

    def close(self) -> None:
        """Stop reading."""
        self._listening.disable_monitor()
        self.socket.close(linger=0)

    def _note(self, event: zmq.Event, value: int) -> None:
        if event is _E.ACCEPTED:
            self.routing_ids.opened(value)
            self._open[value] = address_of(value)
        elif event is _E.HANDSHAKE_SUCCEEDED:
            # Of several at once it does not say which: another address may be named later.
            if self._open:
                self._open.popitem()
        elif event is _E.HANDSHAKE_FAILED_AUTH:
            self._refused += 1
        elif event is _E.DISCONNECTED:
            self.routing_ids.closed(value)
            self._ended(self._open.pop(value, None))
        elif value == errno.EFAULT:  # libzmq refuses the connection
            self._rejections.note("handshake", detail="no authenticator")
        else:
            self._failed = _DETAILS.get(value, f"{value:#x}")

    def _ended(self, address: str | None) -> None:
        failed, self._failed = self._failed, None
        if failed:
            self._rejections.note("handshake", address=address, detail=failed)
        elif address and self._refused:
            self._refused -= 1
        elif address:
            self._rejections.note("handshake", address=address, detail="not ZeroMQ, or broken off")


def address_of(descriptor: int) -> str:
    """Give the address at the other end of a connection, "gone" where it is closed.

    The descriptor may be another file's by now, or that of a socket of another kind.
    """
    with suppress(OSError):
        copy = os.dup(descriptor)
        try:
            connection = socket.socket(fileno=copy)
        except OSError:
            os.close(copy)
            raise
        with connection:
            if connection.family in (socket.AF_INET, socket.AF_INET6):
                host, port, *_ = connection.getpeername()
                return f"{host}:{port}"
    return "gone"
