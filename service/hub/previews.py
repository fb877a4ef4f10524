"""Previews: small pictures of what the sensor sees, while anybody subscribes.

The hub asks for the next one when the last has come, so that none waits in a queue; a press goes
first. None is stored.
"""

import secrets
from collections.abc import Iterator

from denseface.service.hub.peers import Peers
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish, send
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet

PREVIEW_PERIOD_S = 0.1
"""Shortest time between two previews, seconds."""


class Previews:
    """Asks the sensor for previews and publishes them; again after `timeout_s` without one."""

    def __init__(self, peers: Peers, timeout_s: float) -> None:
        self._peers = peers
        self._timeout_s = timeout_s
        self._epoch = secrets.token_hex(8)
        self._sequence = 0
        self._asked: bytes | None = None
        """The sensor that was asked and has not sent one."""
        self._asked_at = float("-inf")
        self.wanted = False
        """Anybody subscribes."""

    def ask(self, now: float, *, busy: bool) -> Iterator[Output]:
        """Ask for a preview where one is due; not while a press waits (`busy`)."""
        sensor = self._peers.sensor()
        pause = PREVIEW_PERIOD_S if self._asked is None else self._timeout_s
        if not self.wanted or busy or sensor is None or now - self._asked_at < pause:
            return
        self._asked, self._asked_at = sensor.peer, now
        yield send(sensor.peer, messages.TakePreview())

    def receive(
        self, peer: bytes, message: messages.PreviewFrame, packet: Packet
    ) -> Iterator[Output]:
        """Publish a preview that was asked for."""
        if peer != self._asked:
            return
        self._asked = None
        if self.wanted:
            self._sequence += 1
            yield Publish(Topic.PREVIEW, Packet(messages.Preview(
                epoch=self._epoch, sequence=self._sequence, preview=message.preview),
                packet.arrays))
