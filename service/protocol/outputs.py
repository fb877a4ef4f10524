"""What the hub gives out: messages to peers and to subscribers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

from denseface.service.protocol.messages import FromHub, Job
from denseface.service.protocol.payload import Arrays
from denseface.service.protocol.wire import Packet

__all__ = ["Output", "Publish", "Send", "Topic", "send", "steps"]


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


def steps(outputs: Sequence[Output]) -> Iterator[Sequence[Output]]:
    """Split what is to be given out before each job.

    Whoever waits for what comes before does not wait for the job, which has a time of its own.
    """
    begin = 0
    for at, output in enumerate(outputs):
        if at > begin and isinstance(output.packet.message, Job):
            yield outputs[begin:at]
            begin = at
    yield outputs[begin:]


def send(peer: bytes, message: FromHub, arrays: Arrays | None = None) -> Send:
    """Address a message to a peer."""
    return Send(peer, Packet(message, arrays or {}))
