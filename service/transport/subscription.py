"""A subscription's socket, read without waiting."""

import os
from collections.abc import Callable
from typing import TypeVar

import zmq

from denseface.service.errors import ProtocolError
from denseface.service.protocol.payload import MAX_PAYLOAD_BYTES
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import MAX_HEADER_BYTES, MAX_PARTS, Packet, decode_from_hub
from denseface.service.transport.connection import Credentials, connect
from denseface.service.transport.sockets import Context, receive_parts

_T = TypeVar("_T")

CHECK_INTERVAL_S = 1.0
"""Interval at which a client asks whether the hub still accepts its key, seconds."""


class Subscription:
    """Subscribes to topics of the publications at an address."""

    def __init__(
        self, context: Context, address: str, keys: Credentials | None,
        topics: tuple[Topic, ...],
    ) -> None:
        self._process = os.getpid()
        self.socket, self.monitor = connect(context, zmq.SUB, address, keys)
        for topic in topics:
            self.socket.subscribe(topic)

    def close(self) -> None:
        """Unsubscribe; harmless when repeated, and in a process that was forked since."""
        if not self.socket.closed and self._process == os.getpid():
            self.monitor.close()
            self.socket.close(linger=0)

    def receive(self) -> Packet | None:
        """Give what has come, None where it is malformed; zmq.Again where nothing has."""
        try:
            _, parts = receive_parts(self.socket, MAX_PARTS, MAX_HEADER_BYTES + MAX_PAYLOAD_BYTES)
            return decode_from_hub([part.buffer for part in parts])
        except ProtocolError:
            return None

    def receive_latest(self, read: Callable[[Packet], _T | None]) -> _T | None:
        """Give the last of what has come that `read` makes something of, pass over the rest."""
        latest = None
        try:
            while True:
                packet = self.receive()
                latest = (read(packet) if packet else None) or latest
        except zmq.Again:
            return latest
