"""Whose each routing id is, and whether its connection is still open.

A routing id is what a peer calls itself, and libzmq gives one that is free again to whoever asks
for it. So an id stays with the key that brought it first, and nothing is sent to an id whose
connection has closed: libzmq closes its descriptor before it frees the id.
"""

import os
from collections import Counter, deque
from contextlib import suppress
from dataclasses import dataclass

from denseface.service.runtime.bounded_dict import BoundedDict

_MAX_GONE = 65_536
"""Ids of closed connections whose key is remembered: 8 MB, 25 MB of the longest."""
_MAX_CLOSED = 1024
"""Closed connections that wait to be taken; of others it is known when their peers are silent."""


@dataclass(frozen=True)
class _Connection:
    key: str
    token: bytes
    descriptor: int
    inode: int
    """Of the connection: the descriptor may be another's by now."""


class RoutingIds:
    """Routing ids of one guarded ROUTER.

    `opened`, `closed` and `all_closed` are told what the socket's monitor says.
    """

    def __init__(self) -> None:
        self._ids: dict[int, bytes | None] = {}
        """Descriptor -> id of each open connection; None before its first message."""
        self._connections: dict[bytes, _Connection] = {}
        self._by_key: Counter[str] = Counter()
        """Number of `_connections` by their key."""
        self._gone: BoundedDict[bytes, str] = BoundedDict(_MAX_GONE)
        """Id -> key of connections that closed."""
        self._closed: deque[bytes] = deque(maxlen=_MAX_CLOSED)
        """Token and id of those that closed and were not taken."""

    def opened(self, descriptor: int) -> None:
        """Note a new connection."""
        self._forget(self._ids.get(descriptor))
        self._ids[descriptor] = None

    def closed(self, descriptor: int) -> None:
        """Note that a connection closed."""
        routing_id = self._ids.pop(descriptor, None)
        if routing_id is not None:
            self._closed.append(self._connections[routing_id].token + routing_id)
        self._forget(routing_id)

    def all_closed(self) -> None:
        """Note that all connections were closed."""
        for descriptor in list(self._ids):
            self._forget(self._ids.pop(descriptor))  # who was cut off comes back

    @property
    def has_closed(self) -> bool:
        """Whether `take_closed` would give anything."""
        return bool(self._closed)

    def take_closed(self) -> list[bytes]:
        """Give token and id of the peers whose connection closed since the last call."""
        closed = [*self._closed]
        self._closed.clear()
        return closed

    def has_spoken(self, descriptor: int) -> bool:
        """Say whether a message came by an open connection."""
        return self._ids.get(descriptor) is not None

    def count(self, key: str) -> int:
        """Give the number of open connections by which a key has spoken."""
        return self._by_key[key]

    def _forget(self, routing_id: bytes | None) -> None:
        """Remember of an id only whose it was."""
        if routing_id is not None:
            key = self._gone[routing_id] = self._connections.pop(routing_id).key
            self._by_key[key] -= 1
            if not self._by_key[key]:
                del self._by_key[key]

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
            self._ids[connection.descriptor] = None
            self._forget(routing_id)
        inode = _inode(descriptor)
        if descriptor not in self._ids or inode is None:  # it closed before its message was read
            self._gone[routing_id] = key
            return True
        if self._ids[descriptor] != routing_id:
            self._forget(self._ids[descriptor])
            self._ids[descriptor] = routing_id
            self._by_key[key] += 1
        self._connections[routing_id] = _Connection(key, token, descriptor, inode)
        return True

    def is_open(self, routing_id: bytes, token: bytes) -> bool:
        """Whether the last message by this id came from that key, by a connection still open."""
        connection = self._connections.get(routing_id)
        return (connection is not None and connection.token == token
                and _inode(connection.descriptor) == connection.inode)


def _inode(descriptor: int) -> int | None:
    with suppress(OSError):
        return os.fstat(descriptor).st_ino
    return None
