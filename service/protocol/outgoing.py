"""Messages that the hub hands over to be sent: to one peer, or to all subscribers of a topic."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from denseface.service.protocol.message_base import FromHub
from denseface.service.protocol.messages import Job
from denseface.service.protocol.payload import Arrays
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet


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
