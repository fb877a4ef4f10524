"""What a subscription to the hub's status tells, and when its silence does: no waiting."""

from dataclasses import dataclass

from denseface.service.protocol.messages import Status
from denseface.service.protocol.wire import Packet
from denseface.service.transport.subscription import Subscription

__all__ = ["LOOK_S", "News", "StatusWatch"]

LOOK_S = 0.2
"""Longest time between two looks, seconds: nobody wakes who waits where a connection ends."""
_FIRST_S = 1.0
"""Longest wait for the first status until the hub counts as gone, seconds: it sends one at once."""
_MISSED = 3
"""Heartbeats that the hub may miss until it counts as gone; as many as it allows others."""


@dataclass(frozen=True)
class News:
    """What is new of the hub."""

    status: Status | None
    """None where the hub is gone."""


class StatusWatch:
    """Reads a subscription to the hub's status."""

    def __init__(self, subscription: Subscription, now: float) -> None:
        self._subscription = subscription
        self._heard, self._patience_s = now, _FIRST_S
        self._gone = False

    def look(self, now: float) -> News | None:
        """Give what is new, None where nothing is; KeyRefusedError where the hub refuses this key.

        The hub is gone where the connection has ended, which a process that ends does at once, and
        where it has been silent for too long. `now` in seconds.
        """
        self._subscription.monitor.check()
        if status := self._subscription.receive_latest(_status):
            self._heard, self._patience_s = now, _MISSED * status.heartbeat_s
            self._gone = False
            return News(status)
        lost = self._subscription.monitor.lost
        if self._gone or not (lost or now - self._heard > self._patience_s):
            return None
        self._gone = True
        return News(None)


def _status(packet: Packet) -> Status | None:
    return packet.message if isinstance(packet.message, Status) else None
