"""One address where the hub listens: local without keys, or guarded.

A listener is a ROUTER for messages and an XPUB for publications. A guarded one has CURVE, an
authenticator without which nobody can connect, and an allow-list that is consulted for each
message: a key that is revoked is cut off at once.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import zmq

from denseface.service.errors import AddressError
from denseface.service.monitoring import Rejections
from denseface.service.protocol.payload import MAX_PAYLOAD_BYTES
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import MAX_HEADER_BYTES, MAX_PARTS, Buffer
from denseface.service.security import AllowedKey
from denseface.service.security.permissions import ALL_ROLES, ROLES_BY_TOPIC
from denseface.service.security.zap import MESSAGES_DOMAIN, PUBLICATIONS_DOMAIN
from denseface.service.transport import sockets
from denseface.service.transport._bound_socket import BoundSocket, ServerCredentials
from denseface.service.transport.addresses import publications_of, socket_file

_TOKEN_BYTES = 8
"""Length of what names a key with its roles, at the start of a peer's name."""
_LOCAL = bytes(_TOKEN_BYTES)
"""Stands for the token where there are no keys."""
_MAX_SUBSCRIPTION_BYTES = 1024
"""MAXMSGSIZE of an XPUB; a handshake is as long."""
_FLOOD = 100
"""Messages of revoked keys between two ticks from which on all connections are cut."""
_BURST = 32
"""Messages taken from one socket at a time, before the loop looks at the clock again."""
_SUBSCRIBES, _UNSUBSCRIBES = b"\1", b"\0"
"""First byte of what an XPUB receives (ZMTP); the topic follows."""
_LOCAL_USER = AllowedKey("", "", ALL_ROLES)
"""Whoever uses a local listener."""


@dataclass(frozen=True)
class Incoming:
    """A message and who sent it."""

    peer: bytes
    """Names the sender's key with its roles, and its connection."""
    parts: list[memoryview]
    """In libzmq's own memory, not to be written to."""
    sender: AllowedKey
    key: str
    """Fingerprint of the sender's key; empty where it needed none."""
    address: str


class Listener:
    """Binds both sockets of one address; AddressError where it cannot be had.

    Where `credentials` is None, whoever can open the address has every role.
    """

    def __init__(
        self, context: sockets.Context, address: str, credentials: ServerCredentials | None,
        rejections: Rejections,
    ) -> None:
        self.address = address
        self._credentials = credentials
        self._rejections = rejections
        self._subscribed: set[bytes] = set()
        """Tokens of the keys that subscribed since the publisher was bound."""
        self._revoked = 0
        """Messages with keys that are no longer allowed, since the last tick."""
        self.subscriptions: dict[Topic, int] = dict.fromkeys(Topic, 0)
        """Number of subscriptions to each topic."""
        router = sockets.open_socket(context, zmq.ROUTER, address)
        router.set(zmq.ROUTER_MANDATORY, 1)
        publisher = sockets.open_socket(context, zmq.XPUB, address)
        publisher.set(zmq.XPUB_MANUAL, 1)
        publisher.set(zmq.MAXMSGSIZE, _MAX_SUBSCRIPTION_BYTES)
        if credentials:
            publisher.set(zmq.LINGER, 0)  # nothing more for a key that is cut off
        self._router = BoundSocket(router, address, MESSAGES_DOMAIN, credentials, rejections)
        self._publisher = BoundSocket(
            publisher, publications_of(address), PUBLICATIONS_DOMAIN, credentials, rejections)
        try:
            self._router.bind()
            self._publisher.bind()
        except BaseException:
            self.close()
            raise

    @property
    def sockets(self) -> list[zmq.Socket[bytes]]:
        """What is to be polled for reading: the ROUTER, then those of `read_events`."""
        both = self._router, self._publisher
        return [*(one.socket for one in both), *(one.monitor.socket for one in both if one.monitor)]

    def close(self) -> None:
        """Unbind and leave no file behind."""
        self._router.close()
        self._publisher.close()
        for address in (self.address, publications_of(self.address)):
            if path := socket_file(address):
                path.unlink(missing_ok=True)

    def receive(self) -> Iterator[Incoming]:
        """Give the messages that have come, a burst of them at most."""
        if monitor := self._router.monitor:
            # First, so that a descriptor used again is not taken for the one that closed.
            monitor.read()
        for _ in range(_BURST):
            try:
                first, parts = sockets.receive_parts(
                    self._router.socket, MAX_PARTS, MAX_HEADER_BYTES + MAX_PAYLOAD_BYTES)
            except zmq.Again:
                return
            except sockets.TooLongError as error:
                user = self._user(error.first)
                self._rejections.note("oversized", key=user.name if user else None,
                                      address=_address(error.first), detail=str(error))
                continue
            if user := self._allowed_user(first):
                token, key = (user.token, user.fingerprint) if self._credentials else (_LOCAL, "")
                incoming = Incoming(token + first.bytes, [part.buffer for part in parts], user, key,
                                    _address(first))
                if self._has_its_own_id(incoming, first):
                    yield incoming

    def read_events(self) -> None:
        """Take note of subscriptions, of their ends and of failed handshakes."""
        for one in (self._router, self._publisher):
            if one.monitor:
                one.monitor.read()
        for _ in range(_BURST):
            try:
                first, _ = sockets.receive_parts(self._publisher.socket, 0, 0)
            except zmq.Again:
                return
            except sockets.TooLongError as error:
                self._rejections.note("malformed", address=_address(error.first),
                                      detail="sent to the publications")
                continue
            self._read_subscription(first)

    def send(self, peer: bytes, parts: Sequence[Buffer]) -> bool:
        """Send to a peer; False where it cannot be reached, or its key was revoked."""
        if not self.is_allowed(peer) or not self._is_connected(peer):
            return False
        try:
            return sockets.send_parts(self._router.socket, [peer[_TOKEN_BYTES:], *parts])
        except zmq.ZMQError as error:
            if error.errno != zmq.EHOSTUNREACH:
                raise
            return False

    def publish(self, topic: Topic, parts: Sequence[Buffer]) -> bool:
        """Send to all who subscribed to a topic; False where one at least could not take it."""
        return sockets.publish_parts(self._publisher.socket, [topic.encode(), *parts])

    def is_allowed(self, peer: bytes) -> bool:
        """Say whether a peer's key is allowed still, with the roles that it had."""
        token = peer[:_TOKEN_BYTES]
        if self._credentials is None:
            return token == _LOCAL
        return self._credentials.allow_list.has_token(token)

    def disconnect_revoked(self) -> None:
        """Cut off keys that are no longer allowed, if they subscribed or go on sending."""
        if self._revoked > _FLOOD:
            self._router.cut()
        self._revoked = 0
        if self._credentials and not all(
                map(self._credentials.allow_list.has_token, self._subscribed)):
            self._cut_publisher()

    def rebind(self) -> None:
        """Listen again where connections were cut."""
        for one in (self._router, self._publisher):
            with suppress(AddressError):  # libzmq's own thread has not closed it yet
                one.bind()

    def disconnect_all(self) -> bool:
        """End every connection from another machine; those that are allowed come back.

        False where that was done already and the address is not yet bound again.
        """
        if not self._credentials or not (self._router.bound or self._publisher.bound):
            return False
        self._router.cut()
        self._cut_publisher()
        return True

    def _cut_publisher(self) -> None:
        self._publisher.cut()
        self._subscribed.clear()

    def _has_its_own_id(self, incoming: Incoming, first: zmq.Frame) -> bool:
        """Say whether a message's routing id is its sender's; note where it came from."""
        if (monitor := self._router.monitor) is None:
            return True
        # libzmq knows no descriptor where the other end had gone before it looked.
        token, descriptor = incoming.peer[:_TOKEN_BYTES], int(_property(first, "__fd") or -1)
        if monitor.routing_ids.claim(first.bytes, incoming.key, token, descriptor):
            return True
        self._rejections.note(
            "identity", key=incoming.sender.name, address=incoming.address,
            detail="calls itself as another key's connection does")
        return False

    def _is_connected(self, peer: bytes) -> bool:
        """Say whether a peer's own connection is still open: its id may be another's by now."""
        monitor = self._router.monitor
        if monitor is None:
            return True
        monitor.read()
        return monitor.routing_ids.is_open(peer[_TOKEN_BYTES:], peer[:_TOKEN_BYTES])

    def _user(self, first: zmq.Frame) -> AllowedKey | None:
        if self._credentials is None:
            return _LOCAL_USER
        return self._credentials.allow_list.get(_property(first, "User-Id"))

    def _allowed_user(self, first: zmq.Frame) -> AllowedKey | None:
        user = self._user(first)
        if user is None:
            self._revoked += 1
            self._rejections.note("revoked key", address=_address(first),
                                  key=_property(first, "User-Id"))
        return user

    def _read_subscription(self, first: zmq.Frame) -> None:
        action, name = first.bytes[:1], first.bytes[1:].decode("utf-8", "replace")
        topic = Topic(name) if name in set(Topic) else None
        if topic and action in (_SUBSCRIBES, _UNSUBSCRIBES):
            # Refused ones are counted too: libzmq tells of their end as of any other.
            change = 1 if action == _SUBSCRIBES else -1
            self.subscriptions[topic] = max(0, self.subscriptions[topic] + change)
        if action == _UNSUBSCRIBES:
            if topic:
                self._publisher.socket.set(zmq.UNSUBSCRIBE, topic.encode())
            return
        user = self._allowed_user(first)
        if user is None:
            return
        if action != _SUBSCRIBES or topic is None:
            self._rejections.note("malformed", key=user.name, address=_address(first),
                                  detail=f"no topic {name[:32]!r}")
        elif not user.roles & ROLES_BY_TOPIC[topic]:
            self._rejections.note("role", key=user.name, address=_address(first),
                                  detail=f"topic {topic}")
        else:
            self._subscribed.add(user.token)
            self._publisher.socket.set(zmq.SUBSCRIBE, topic.encode())


def _property(frame: zmq.Frame, name: str) -> str:
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return ""


def _address(frame: zmq.Frame) -> str:
    return _property(frame, "Peer-Address") or "local"
