"""Who subscribed to which topic, by connection.

By connection, for a topic that one of them names three times ends once, and what one never named
is not another's to end.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from denseface.service.protocol.topics import Topic

_MAX_UNKNOWN = 16
"""Topics that do not exist and that one connection may name: libzmq keeps each as long as the
connection lasts, at 48 bytes for each of its bytes."""
_MAX_PER_KEY = 64
"""Connections of one key that may be subscribed at a time."""


@dataclass
class _Subscriber:
    token: bytes = b""
    topics: set[Topic] = field(default_factory=set)
    unknown: int = 0


class Subscribers:
    """Connections of one XPUB.

    `opened`, `closed` and `all_closed` are told what the socket's monitor says. A connection that
    is not open any more subscribes to nothing.

    Parameters
    ----------
    watch : is given each new connection
    """

    def __init__(self, watch: Callable[[int], None] | None = None) -> None:
        self._watch = watch
        self._connections: dict[int, _Subscriber] = {}
        """By descriptor."""

    def opened(self, descriptor: int) -> None:
        """Note a new connection."""
        self._connections[descriptor] = _Subscriber()
        if self._watch:
            self._watch(descriptor)

    def closed(self, descriptor: int) -> None:
        """Note that a connection closed."""
        self._connections.pop(descriptor, None)

    def all_closed(self) -> None:
        """Note that all connections were closed."""
        self._connections.clear()

    def is_open(self, descriptor: int) -> bool:
        """Say whether a connection is open and was not given up."""
        return descriptor in self._connections

    def has_spoken(self, descriptor: int) -> bool:
        """Say whether a connection has subscribed to a topic."""
        return descriptor in self._connections and bool(self._connections[descriptor].topics)

    def subscribe(self, descriptor: int, token: bytes, topic: Topic) -> bool:
        """Note a subscription; False where the key has too many connections.

        Parameters
        ----------
        token : of the key with its roles; empty where it needed none
        """
        one = self._connections[descriptor]
        if token != one.token:
            of_key = sum(other.token == token for other in self._connections.values())
            if of_key >= _MAX_PER_KEY:
                return False
            one.token = token
        one.topics.add(topic)
        return True

    def unsubscribe(self, descriptor: int, topic: Topic) -> None:
        """Note the end of a subscription, if there was one."""
        self._connections[descriptor].topics.discard(topic)

    def name_unknown(self, descriptor: int) -> bool:
        """Note that a connection named what is no topic; False where it did so too often."""
        one = self._connections[descriptor]
        one.unknown += 1
        return one.unknown <= _MAX_UNKNOWN

    def descriptors(self) -> list[int]:
        """Give the open connections."""
        return list(self._connections)

    def count(self, topic: Topic) -> int:
        """Give the number of connections that are subscribed to a topic."""
        return sum(topic in one.topics for one in self._connections.values())

    def tokens(self) -> set[bytes]:
        """Give the tokens of the keys that have subscribed."""
        return {one.token for one in self._connections.values() if one.token}
