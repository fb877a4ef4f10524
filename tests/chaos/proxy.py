"""A network between the daemons and the hub that loses, doubles, delays and reorders messages."""

import random
import threading
import time
from collections import Counter
from types import TracebackType
from typing import Self

import zmq

from tests.waiting import LIMIT_S

__all__ = ["Proxy"]

_LONGEST_S = 0.15
"""Longest delay of a message that is held back, seconds: others pass it."""
_QUIET_S = 5.0
"""A way whose daemon said nothing for this long is closed, seconds."""


class Proxy:
    """Forwards between `address` and the hub, each daemon by a connection of its own.

    Parameters
    ----------
    hub : the hub's address; the proxy's own is beside it
    lose, double, delay : chances of each message, from 0 to 1
    """

    def __init__(
        self, hub: str, seed: int, *, lose: float = 0.0, double: float = 0.0, delay: float = 0.0
    ) -> None:
        self.address = f"{hub}-proxy"
        self.counts: Counter[str] = Counter()
        self._hub = hub
        self._random = random.Random(seed)
        self._chances = {"lost": lose, "doubled": double, "delayed": delay}
        self._ways: dict[bytes, zmq.Socket[bytes]] = {}
        self._heard: dict[bytes, float] = {}
        self._held: list[tuple[float, zmq.Socket[bytes], list[bytes]]] = []
        self._leave = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._leave.set()
        self._thread.join(LIMIT_S)

    def _run(self) -> None:
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        front = context.socket(zmq.ROUTER)
        front.bind(self.address)
        while not self._leave.is_set():
            poller = zmq.Poller()
            for one in (front, *self._ways.values()):
                poller.register(one, zmq.POLLIN)
            for socket, _ in poller.poll(10):
                if socket is front:
                    daemon, *parts = front.recv_multipart()
                    self._heard[daemon] = time.monotonic()
                    self._pass(self._way(context, daemon), parts)
                else:
                    daemon = next(key for key, way in self._ways.items() if way is socket)
                    self._pass(front, [daemon, *socket.recv_multipart()])
            self._release()
        context.destroy(linger=0)

    def _way(
        self, context: "zmq.Context[zmq.Socket[bytes]]", daemon: bytes
    ) -> "zmq.Socket[bytes]":
        """Give the connection of a daemon; close those of daemons that are gone."""
        now = time.monotonic()
        for gone in [key for key, at in self._heard.items() if at < now - _QUIET_S]:
            del self._heard[gone]
            if way := self._ways.pop(gone, None):
                self._held = [one for one in self._held if one[1] is not way]
                way.close(0)
        if daemon not in self._ways:
            way = self._ways[daemon] = context.socket(zmq.DEALER)
            way.set(zmq.IMMEDIATE, 1)
            way.set(zmq.RECONNECT_IVL, 20)
            way.connect(self._hub)
        return self._ways[daemon]

    def _pass(self, to: "zmq.Socket[bytes]", parts: list[bytes]) -> None:
        fates = [*self._chances, "passed"]
        weights = [*self._chances.values(), 1 - sum(self._chances.values())]
        (fate,) = self._random.choices(fates, weights)
        self.counts[fate] += 1
        if fate == "lost":
            return
        if fate == "delayed":
            until = time.monotonic() + self._random.random() * _LONGEST_S
            self._held.append((until, to, parts))
            return
        for _ in range(2 if fate == "doubled" else 1):
            self._send(to, parts)

    def _release(self) -> None:
        now = time.monotonic()
        due = [one for one in self._held if one[0] <= now]
        self._held = [one for one in self._held if one[0] > now]
        self._random.shuffle(due)
        for _, to, parts in due:
            self._send(to, parts)

    def _send(self, to: "zmq.Socket[bytes]", parts: list[bytes]) -> None:
        try:
            to.send_multipart(parts, zmq.DONTWAIT)
        except zmq.Again:
            self.counts["lost"] += 1
