"""Previews and hints: what the sensors see and think of it, while anybody subscribes.

The hub asks each sensor for its next preview when the last has come, so that none waits in a queue;
a press goes first. Hints a sensor sends by itself, for as long as it was asked to. None is stored.
"""

import math
import secrets
from collections.abc import Container, Iterator
from dataclasses import dataclass

from denseface.service.errors import RemoteProtocolError
from denseface.service.hub._common import LOCAL
from denseface.service.hub.peers import Peers
from denseface.service.monitoring import Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish, send
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet

_PERIOD_S = 1 / 30
"""Shortest time between two previews of a sensor, seconds: the rate of these sensors."""
_MOST_PER_S = 120
"""Previews a second of all sensors together."""
_HINT_PERIOD_S = 0.05
"""Shortest time between two hints of a sensor, seconds: they come ten times a second."""
_HINT_HEARTBEATS = 3
"""Heartbeats for which a sensor is asked for hints, each time again."""


@dataclass
class _Ask:
    at: float
    """When, seconds."""
    awaited: bool = True
    """Nothing came since."""


class Previews:
    """Asks the sensors for previews and publishes them; again after `timeout_s` without one."""

    def __init__(self, peers: Peers, timeout_s: float, rejections: Rejections) -> None:
        self._peers = peers
        self._timeout_s = timeout_s
        self._rejections = rejections
        self._epoch = secrets.token_hex(8)
        self._sequence = 0
        self._asks: dict[bytes, _Ask] = {}
        """The last one of each sensor."""
        self.wanted = False
        """Anybody subscribes."""

    def ask(self, now: float, busy: Container[bytes]) -> Iterator[Output]:
        """Ask for the previews that are due, not of the `busy` sensors: a press waits there."""
        self._asks = {peer: one for peer, one in self._asks.items() if peer in self._peers.sensors}
        for peer, due in list(self._due(busy)):
            if now >= due:
                self._asks[peer] = _Ask(now)
                yield send(peer, messages.TakePreview())

    def next_due(self, busy: Container[bytes]) -> float:
        """Give when the next preview is to be asked for, seconds; infinite where none is."""
        return min((due for _, due in self._due(busy)), default=math.inf)

    def _due(self, busy: Container[bytes]) -> Iterator[tuple[bytes, float]]:
        if not self.wanted:
            return
        shown = [one.peer for one in self._peers.sensors.values() if one.streams]
        period = max(_PERIOD_S, len(shown) / _MOST_PER_S)
        for peer in shown:
            if peer in busy:
                continue
            last = self._asks.get(peer)
            yield peer, (-math.inf if last is None else
                         last.at + (self._timeout_s if last.awaited else period))

    def receive(
        self, peer: bytes, message: messages.PreviewFrame, packet: Packet
    ) -> Iterator[Output]:
        """Publish a preview that was asked for."""
        asked, sensor = self._asks.get(peer), self._peers.sensors.get(peer)
        if asked is None or sensor is None or not asked.awaited:
            return
        try:
            message.preview.check(packet.arrays)
        except RemoteProtocolError as error:  # the next one is asked for when this one is late
            self._rejections.note(
                error.reason, key=sensor.key or LOCAL, name=sensor.name, detail=str(error))
            return
        asked.awaited = False
        if self.wanted:
            self._sequence += 1
            yield Publish(Topic.PREVIEW, Packet(messages.Preview(
                epoch=self._epoch, sequence=self._sequence,
                preview=message.preview.model_copy(update={"sensor": sensor.name})),
                packet.arrays))


class Hints:
    """Asks the sensors for hints at each heartbeat and publishes them."""

    def __init__(self, peers: Peers, heartbeat_s: float) -> None:
        self._peers = peers
        self._heartbeat_s = heartbeat_s
        self._due = -math.inf
        self._last: dict[bytes, float] = {}
        """When each sensor's last hint was published, seconds."""
        self.wanted = False
        """Anybody subscribes."""

    def ask(self, now: float) -> Iterator[Output]:
        """Ask for hints where that is due."""
        if not self.wanted or now < self._due:
            return
        self._due = now + self._heartbeat_s
        self._last = {peer: at for peer, at in self._last.items() if peer in self._peers.sensors}
        for sensor in self._peers.sensors.values():
            if sensor.can_be_asked:
                yield send(sensor.peer, messages.TakeHints(
                    seconds=_HINT_HEARTBEATS * self._heartbeat_s))

    def receive(
        self, now: float, peer: bytes, message: messages.QualityHint
    ) -> Iterator[Output]:
        """Publish a sensor's hint, unless nobody wants it or it comes too soon after the last."""
        sensor = self._peers.sensors.get(peer)
        if (not self.wanted or sensor is None
                or now - self._last.get(peer, -math.inf) < _HINT_PERIOD_S):
            return
        self._last[peer] = now
        yield Publish(Topic.HINTS, Packet(messages.Hints(sensor=sensor.name, hint=message.hint)))
