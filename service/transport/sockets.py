"""ZeroMQ sockets with every limit set."""

import ctypes
import secrets
from collections.abc import Sequence

import zmq

from denseface.service.errors import RemoteProtocolError
from denseface.service.protocol.payload import MAX_ARRAY_BYTES
from denseface.service.protocol.wire import Buffer

Socket = zmq.Socket[bytes]
Context = zmq.Context[Socket]

_HIGH_WATER_MARK = 16
"""Messages that may wait in one direction for one peer, some of many megabytes; beyond it they
are dropped, and asked for again."""
_LINGER_MS = 500
"""How long a closing socket tries to deliver its last messages, milliseconds."""
_RECONNECT_MS, _RECONNECT_MAX_MS = 50, 500
"""Shortest and longest time until libzmq connects again, milliseconds."""


class TooLongError(RemoteProtocolError):
    """A message had more parts or bytes than it may; what is not named here was dropped."""

    def __init__(self, message: str, first: zmq.Frame, next_parts: list[zmq.Frame]) -> None:
        super().__init__(message, "oversized")
        self.first = first
        """Its first part, which carries what libzmq knows of the sender."""
        self.next_parts = next_parts
        """The part that followed, where it was within the limits."""


def open_socket(context: Context, kind: int, address: str) -> Socket:
    """Make a socket for an address, with high-water marks, linger and size limit set."""
    if kind == zmq.ROUTER:
        # libzmq numbers its peers from `rand()`, which it never seeds, and aborts where a peer has
        # taken the number that comes next for its name.
        ctypes.CDLL(None).srand(secrets.randbits(32))
    socket = context.socket(kind)
    if address.startswith("tcp://["):
        socket.set(zmq.IPV6, 1)
    socket.set(zmq.SNDHWM, _HIGH_WATER_MARK)
    socket.set(zmq.RCVHWM, _HIGH_WATER_MARK)
    socket.set(zmq.LINGER, _LINGER_MS)
    socket.set(zmq.MAXMSGSIZE, MAX_ARRAY_BYTES)
    socket.set(zmq.RECONNECT_IVL, _RECONNECT_MS)
    socket.set(zmq.RECONNECT_IVL_MAX, _RECONNECT_MAX_MS)
    return socket


def open_monitor(socket: Socket, events: int) -> Socket:
    """Open a monitor of a socket, whose queue has no limit.

    Where it had one, libzmq's own thread would wait at a full queue with the lock that `bind`,
    `unbind` and `disable_monitor` need: whoever calls those does not read meanwhile.
    """
    address = f"inproc://monitor-{secrets.token_hex(8)}"
    socket.monitor(address, events)
    monitor: Socket = socket.context.socket(zmq.PAIR)
    monitor.set(zmq.RCVHWM, 0)
    monitor.connect(address)
    return monitor


def send_parts(socket: Socket, parts: Sequence[Buffer]) -> bool:
    """Send without waiting; False where nobody can take it now.

    Large parts are not copied and must not be changed afterwards.
    """
    try:
        socket.send_multipart(parts, flags=zmq.DONTWAIT, copy=False)
    except zmq.Again:
        return False
    return True


def publish_parts(publisher: Socket, parts: Sequence[Buffer]) -> bool:
    """Send to all subscribers of an XPUB; False where a subscriber's queue was found full.

    The others get the message all the same. libzmq skips a full queue unseen until half of it was
    read, so False says that a subscriber fell behind, not how much it missed.
    """
    # Makes libzmq process what subscribers have read meanwhile, which it does not at every sending:
    # it would take those that keep up, or have caught up, for slow ones. By poll, as only that lets
    # other threads run: it processes what subscribers say too, and some may not stop.
    publisher.poll(0)
    publisher.set(zmq.XPUB_NODROP, 1)
    try:
        publisher.send_multipart(parts, flags=zmq.DONTWAIT, copy=False)
    except zmq.Again:
        publisher.set(zmq.XPUB_NODROP, 0)
        publisher.send_multipart(parts, flags=zmq.DONTWAIT, copy=False)
        return False
    return True


def receive_parts(socket: Socket, most: int, most_bytes: int) -> tuple[zmq.Frame, list[zmq.Frame]]:
    """Receive without waiting: the first part with its properties, and those that follow it.

    zmq.Again where there is none, TooLongError where more than `most` parts or `most_bytes` bytes
    follow the first: all of them are received, and most are dropped.
    """
    first = frame = socket.recv(zmq.DONTWAIT, copy=False, track=False)
    parts: list[zmq.Frame] = []
    count = size = 0
    while frame.more:
        frame = socket.recv(zmq.DONTWAIT, copy=False, track=False)
        count += 1
        size += len(frame)
        if count <= most and size <= most_bytes:
            parts.append(frame)
    if count > most or size > most_bytes:
        raise TooLongError(
            f"{count} parts with {size} bytes, at most {most} with {most_bytes} allowed",
            first, parts[:1])
    return first, parts
