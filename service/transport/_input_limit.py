"""How much may come in by a connection whose other end has little to say.

libzmq takes subscriptions as long as more of them come, within one call: whoever sends them without
pause holds the thread that made the call, and fills the memory with what it sent. So another thread
counts what each connection receives, and ends it.
"""

import select
import socket
import struct
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass

from denseface.service.runtime.token_bucket import TokenBucket
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.transport.handshakes import address_of, connection_of, end_connection

_BURST_BYTES = 4096
"""What a connection may receive at once: its handshake (0.6 kB) and some fifty subscriptions."""
_BYTES_PER_S = 1024
"""What it may receive a second in the long run: heartbeats of ZMTP, subscriptions that change."""
_TCP_INFO_RECEIVED = 128
"""Offset of `tcpi_bytes_received` in `struct tcp_info` (linux/tcp.h), 8 bytes; since Linux 4.1."""


@dataclass
class _Budget:
    address: str
    bytes: TokenBucket
    received: int = 0


class InputLimit:
    """Ends TCP connections that receive too much; its thread runs until `close`.

    Attributes
    ----------
    ended : addresses at the other ends of those that were ended
    """

    def __init__(self) -> None:
        self.ended: deque[str] = deque()
        self._budgets: dict[int, _Budget] = {}
        self._epoll = select.epoll()
        self._stop = WakePipe()
        self._epoll.register(self._stop.fileno(), select.EPOLLIN)
        self._thread = threading.Thread(target=self._run, name="input limit", daemon=True)
        self._thread.start()

    def watch(self, descriptor: int) -> None:
        """Watch a connection until it is closed, which nobody needs to tell."""
        self._budgets[descriptor] = _Budget(
            address_of(descriptor), TokenBucket(_BURST_BYTES, _BYTES_PER_S, time.monotonic()))
        with suppress(OSError):  # it is closed already, or was watched under this number before
            self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLET)

    def close(self) -> None:
        """End the thread."""
        self._stop.wake()
        self._thread.join()
        self._epoll.close()
        self._stop.close()

    def _run(self) -> None:
        while True:
            for descriptor, _ in self._epoll.poll():
                if descriptor == self._stop.fileno():
                    return
                self._check(descriptor)

    def _check(self, descriptor: int) -> None:
        budget = self._budgets.get(descriptor)
        if budget is None or budget.address != address_of(descriptor):
            return  # the number is another connection's by now
        received = _received_bytes(descriptor)
        budget.bytes.refill(time.monotonic())
        budget.bytes.tokens -= received - budget.received
        budget.received = received
        if budget.bytes.tokens < 0:
            del self._budgets[descriptor]  # first: the number is free for another soon
            end_connection(descriptor)
            self.ended.append(budget.address)


def _received_bytes(descriptor: int) -> int:
    """Give what a TCP connection has received so far; 0 where the system does not say."""
    with suppress(OSError, struct.error), connection_of(descriptor) as connection:
        info = connection.getsockopt(
            socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO_RECEIVED + struct.calcsize("Q"))
        return int(struct.unpack_from("=Q", info, _TCP_INFO_RECEIVED)[0])
    return 0
