"""Whose each routing id is, and whether its connection is still open.

A routing id is what a peer calls itself, and libzmq gives one that is free again to whoever asks
for it. So an id stays with the key that brought it first, and nothing is sent to an id whose
connection has closed: libzmq reports the closing before it frees the id.
"""

from dataclasses import dataclass

from denseface.service.runtime.bounded_dict import BoundedDict

_MAX_GONE = 65_536
"""Ids of closed connections whose key is remembered; about 10 MB."""


@dataclass(frozen=True)
class _Connection:
    key: str
    token: bytes
    descriptor: int


class RoutingIds:
    """Routing ids of one guarded ROUTER.

    `opened`, `closed` and `all_closed` are told what the socket's monitor says.
    """

    def __init__(self) -> None:
        self._descriptors: set[int] = set()
        self._connections: dict[bytes, _Connection] = {}
        self._by_descriptor: dict[int, bytes] = {}
        self._gone: BoundedDict[bytes, str] = BoundedDict(_MAX_GONE)
        """Id -> key of connections that closed."""

    def opened(self, descriptor: int) -> None:
        """Note a new connection."""
        self._descriptors.add(descriptor)

    def closed(self, descriptor: int) -> None:
        """Note that a connection closed."""
        self._descriptors.discard(descriptor)
        if (routing_id := self._by_descriptor.pop(descriptor, None)) is not None:
            self._gone[routing_id] = self._connections.pop(routing_id).key

    def all_closed(self) -> None:
        """Note that all connections were closed."""
        for descriptor in list(self._by_descriptor):
            self.closed(descriptor)
        self._descriptors.clear()

    def claim(self, routing_id: bytes, key: str, token: bytes, descriptor: int) -> bool:
        """Note a message of a connection; False where its id is another key's.

        Parameters
        ----------
        key : fingerprint of the key
        token : of the key with its roles
        """
        connection = self._connections.get(routing_id)
        owner = connection.key if connection else self._gone.get(routing_id)
        if owner is not None and owner != key:
            return False
        if connection and connection.descriptor != descriptor:
            self._by_descriptor.pop(connection.descriptor, None)
        if descriptor not in self._descriptors:  # it closed before its message was read
            self._connections.pop(routing_id, None)
            self._gone[routing_id] = key
            return True
        before = self._by_descriptor.get(descriptor)
        if before is not None and before != routing_id:
            self._gone[before] = self._connections.pop(before).key
        self._by_descriptor[descriptor] = routing_id
        self._connections[routing_id] = _Connection(key, token, descriptor)
        return True

    def is_open(self, routing_id: bytes, token: bytes) -> bool:
        """Whether the last message by this id came from that key, by a connection still open."""
        connection = self._connections.get(routing_id)
        return connection is not None and connection.token == token
