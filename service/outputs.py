"""What the hub gives out: messages to peers and to subscribers."""

from dataclasses import dataclass
from enum import StrEnum

from service.messages import FromHub
from service.payload import Arrays
from service.wire import Packet

__all__ = ["Output", "Publish", "Send", "Topic", "send"]


class Topic(StrEnum):
    """What may be subscribed to."""

    FACES = "faces"
    """`FaceDone` and `CaptureFailed`, numbered without gaps."""
    STATUS = "status"
    """`Status`, at every heartbeat."""
    PREVIEW = "preview"
    """`Preview`, ten a second at most while somebody subscribes."""


@dataclass(frozen=True)
class Send:
    """A message to one peer."""

    peer: bytes
    packet: Packet


@dataclass(frozen=True)
class Publish:
    """A message to all subscribers of a topic."""

    topic: Topic
    packet: Packet


Output = Send | Publish


def send(peer: bytes, message: FromHub, arrays: Arrays | None = None) -> Send:
    """Address a message to a peer."""
    return Send(peer, Packet(message, arrays or {}))
