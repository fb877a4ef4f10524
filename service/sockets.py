"""ZeroMQ sockets with every limit set."""

import zmq

from service.payload import MAX_ARRAY_BYTES

__all__ = ["connect", "open_socket", "send_parts"]

_HIGH_WATER_MARK = 16
"""Messages that may wait in one direction for one peer, some of many megabytes; beyond it they
are dropped, and asked for again."""
_LINGER_MS = 500
"""How long a closing socket tries to deliver its last messages."""
_RECONNECT_MS, _RECONNECT_MAX_MS = 50, 500


def open_socket(context: "zmq.Context[zmq.Socket[bytes]]", kind: int) -> "zmq.Socket[bytes]":
    """Open a socket with high-water marks, linger and the largest message part set."""
    socket = context.socket(kind)
    socket.set(zmq.SNDHWM, _HIGH_WATER_MARK)
    socket.set(zmq.RCVHWM, _HIGH_WATER_MARK)
    socket.set(zmq.LINGER, _LINGER_MS)
    socket.set(zmq.MAXMSGSIZE, MAX_ARRAY_BYTES)
    socket.set(zmq.RECONNECT_IVL, _RECONNECT_MS)
    socket.set(zmq.RECONNECT_IVL_MAX, _RECONNECT_MAX_MS)
    return socket


def connect(
    context: "zmq.Context[zmq.Socket[bytes]]", kind: int, address: str
) -> "zmq.Socket[bytes]":
    """Open a socket toward the hub, which may come later."""
    socket = open_socket(context, kind)
    if kind == zmq.DEALER:
        # Nothing is queued for a hub that is not there: it would arrive stale.
        socket.set(zmq.IMMEDIATE, 1)
    socket.connect(address)
    return socket


def send_parts(socket: "zmq.Socket[bytes]", parts: list[bytes]) -> bool:
    """Send without waiting; False where nobody can take it now."""
    try:
        socket.send_multipart(parts, flags=zmq.DONTWAIT)
    except zmq.Again:
        return False
    return True
