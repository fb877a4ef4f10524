"""Connections that never became any: garbage, other mechanisms, wrong keys, silence.

libzmq ends them by itself and says so on a socket's monitor, which is read here to count them.
"""

import errno
import os
import socket
from contextlib import suppress

import zmq
from zmq.utils.monitor import parse_monitor_message

from denseface.service.monitoring.rejections import Rejections

__all__ = ["HandshakeMonitor", "address_of"]

_BURST = 64
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
    """Listens to what libzmq says of one listening socket's connections."""

    def __init__(self, listening: "zmq.Socket[bytes]", rejections: Rejections) -> None:
        self._rejections = rejections
        self._listening = listening
        self.socket = listening.get_monitor_socket(int(_EVENTS))
        self._open: dict[int, str] = {}
        """Descriptor and address of connections that have not said who they are."""
        self._failed: str | None = None
        self._unknown = 0
        """Connections refused by the authenticator, which has counted them, and not yet closed."""

    def read(self) -> None:
        """Take note of what happened."""
        for _ in range(_BURST):
            try:
                parts = self.socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                return
            said = parse_monitor_message(parts)
            self._note(zmq.Event(said["event"]), said["value"])

    def forget(self) -> None:
        """Take note that all connections were cut, of which libzmq says nothing."""
        self.read()
        self._open.clear()

    def close(self) -> None:
        """Listen no more."""
        self._listening.disable_monitor()
        self.socket.close(linger=0)

    def _note(self, event: zmq.Event, value: int) -> None:
        if event is _E.ACCEPTED:
            self._open[value] = address_of(value)
        elif event is _E.HANDSHAKE_SUCCEEDED:
            # It does not say whose: where several knock at once, another may be named later.
            if self._open:
                self._open.popitem()
        elif event is _E.HANDSHAKE_FAILED_AUTH:
            self._unknown += 1
        elif event is _E.DISCONNECTED:
            self._ended(self._open.pop(value, None))
        elif value == errno.EFAULT:  # and libzmq goes on to keep the connection shut
            self._rejections.note("handshake", detail="no authenticator")
        else:
            self._failed = _DETAILS.get(value, f"{value:#x}")  # DISCONNECTED follows

    def _ended(self, address: str | None) -> None:
        failed, self._failed = self._failed, None
        if failed:
            self._rejections.note("handshake", address=address, detail=failed)
        elif address and self._unknown:
            self._unknown -= 1
        elif address:
            self._rejections.note("handshake", address=address, detail="not ZeroMQ, or broken off")


def address_of(descriptor: int) -> str:
    """Say who is at the other end of a connection, "gone" where it is closed.

    The number may be that of another file by now, or of a socket of another kind.
    """
    try:
        copy = os.dup(descriptor)
    except OSError:
        return "gone"
    try:
        connection = socket.socket(fileno=copy)
    except OSError:
        os.close(copy)
        return "gone"
    with connection, suppress(OSError):
        if connection.family in (socket.AF_INET, socket.AF_INET6):
            host, port, *_ = connection.getpeername()
            return f"{host}:{port}"
    return "gone"
