"""One address where the hub listens: local without keys, or guarded.

A listener is a ROUTER for messages and an XPUB for publications. A guarded one has CURVE, an
authenticator without which nobody can connect, and an allow-list that is consulted for each
message: a key that is revoked is cut off at once.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import structlog
import zmq

from denseface.service.errors import AddressError, RemoteProtocolError
from denseface.service.monitoring import Rejections
from denseface.service.protocol.payload import MAX_PAYLOAD_BYTES
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import (
    MAX_HEADER_BYTES,
    MAX_PARTS,
    Buffer,
    Packet,
    decode_to_hub,
)
from denseface.service.security import AllowedKey
from denseface.service.security.permissions import ALL_ROLES, ROLES_BY_TOPIC
from denseface.service.security.zap import MESSAGES_DOMAIN, PUBLICATIONS_DOMAIN
from denseface.service.transport import sockets
from denseface.service.transport._bound_socket import BoundSocket, ServerCredentials
from denseface.service.transport._input_limit import InputLimit
from denseface.service.transport._key_limits import MAX_CONNECTIONS
from denseface.service.transport._routing_ids import RoutingIds
from denseface.service.transport._subscribers import Subscribers
from denseface.service.transport.addresses import publications_of
from denseface.service.transport.handshakes import end_connection

_TOKEN_BYTES = 8
"""Length of what names a key with its roles, at the start of a peer's name."""
_LOCAL = bytes(_TOKEN_BYTES)
"""Stands for the token where there are no keys."""
_MAX_SUBSCRIPTION_BYTES = 1024
"""MAXMSGSIZE of an XPUB; a handshake is as long."""
_PUBLISHER_RCVBUF = 4096
"""RCVBUF of a guarded XPUB: what a connection that is ended may still have to be read."""
_FLOOD = 100
"""Messages of revoked keys between two ticks from which on all connections are cut."""
_BURST = 32
"""Messages taken from one socket at a time, before the loop looks at the clock again."""
_SUBSCRIBES, _UNSUBSCRIBES = b"\1", b"\0"
"""First byte of what an XPUB receives (ZMTP); the topic follows."""
_LOCAL_USER = AllowedKey("", "", ALL_ROLES)
"""Whoever uses a local listener."""
_log = structlog.get_logger("hub")


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
    fault: RemoteProtocolError | None = None
    """The message was too long: of its parts there is the first at most."""

    def packet(self) -> Packet:
        """Read the message; RemoteProtocolError where it is malformed."""
        if self.fault:
            raise self.fault
        return decode_to_hub(self.parts)


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
        self._revoked = 0
        """Messages with keys that are no longer allowed, since the last tick."""
        self._routing_ids = RoutingIds()
        # Without credentials whoever connects is this machine's user.
        self._input_limit = InputLimit() if credentials else None
        self._subscribers = Subscribers(self._input_limit.watch if self._input_limit else None)
        self._mixed_up = False
        """libzmq may take what is read next for another connection's."""
        self.unreachable: str | None = None
        """Why nobody can connect any more; None where all is well."""
        router = sockets.open_socket(context, zmq.ROUTER, address)
        router.set(zmq.ROUTER_MANDATORY, 1)
        publisher = sockets.open_socket(context, zmq.XPUB, address)
        publisher.set(zmq.XPUB_MANUAL, 1)
        publisher.set(zmq.MAXMSGSIZE, _MAX_SUBSCRIPTION_BYTES)
        if credentials:
            publisher.set(zmq.LINGER, 0)  # nothing more for a key that is cut off
            publisher.set(zmq.RCVBUF, _PUBLISHER_RCVBUF)
        self._router = BoundSocket(router, address, MESSAGES_DOMAIN, credentials, rejections,
                                   self._routing_ids)
        self._publisher = BoundSocket(
            publisher, publications_of(address), PUBLICATIONS_DOMAIN, credentials, rejections,
            self._subscribers)
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
        return [*(one.socket for one in both), *(one.monitor.socket for one in both)]

    def close(self) -> None:
        """Unbind and leave no file of its own behind."""
        self._router.close()
        self._publisher.close()
        if self._input_limit:
            self._input_limit.close()

    def receive(self) -> Iterator[Incoming]:
        """Give the messages that have come, a burst of them at most."""
        # First, so that a descriptor used again is not taken for the one that closed.
        self._router.monitor.read()
        for _ in range(_BURST):
            fault = None
            try:
                first, parts = sockets.receive_parts(
                    self._router.socket, MAX_PARTS, MAX_HEADER_BYTES + MAX_PAYLOAD_BYTES)
            except zmq.Again:
                return
            except sockets.TooLongError as error:
                first, parts, fault = error.first, error.next_parts, error
            if user := self._allowed_user(first):
                token, key = (user.token, user.fingerprint) if self._credentials else (_LOCAL, "")
                incoming = Incoming(token + first.bytes, [part.buffer for part in parts], user, key,
                                    _address(first), fault)
                if self._has_its_own_id(incoming, first):
                    yield incoming

    def read_events(self) -> None:
        """Take note of subscriptions, of their ends and of failed handshakes."""
        self.read_monitors()
        for _ in range(_BURST):
            try:
                # By frames: libzmq queues those of several connections one behind the other, and
                # who sends half a message would swallow what another says next.
                frame = self._publisher.socket.recv(zmq.DONTWAIT, copy=False, track=False)
            except zmq.Again:
                self._mixed_up = False
                return
            self._read_subscription(frame)

    def read_monitors(self) -> None:
        """Take note of who has connected and who has gone."""
        self._router.monitor.read()
        self._publisher.monitor.read()

    def take_gone(self) -> list[bytes]:
        """Give the peers whose connection has ended by itself, when all that they said is read."""
        if not self._routing_ids.has_closed or self._router.socket.poll(0):
            return []
        return self._routing_ids.take_closed()

    def subscriptions(self, topic: Topic) -> int:
        """Give the number of connections that are subscribed to a topic."""
        return self._subscribers.count(topic)

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

    def tick(self) -> None:
        """Cut off keys that are no longer allowed, if they subscribed or go on sending."""
        for one, cut in ((self._router, self._router.cut), (self._publisher, self._cut_publisher)):
            if one.monitor.flooded:
                cut()
                self._rejections.note("connections", detail="a flood: all of a port are cut")
            if self._credentials:
                one.limit_silent()
        if self._revoked > _FLOOD:
            self._router.cut()
        self._revoked = 0
        if self._credentials and not all(
                map(self._credentials.allow_list.has_token, self._subscribers.tokens())):
            self._cut_publisher()
        while self._input_limit and self._input_limit.ended:
            self._rejections.note("subscriptions", address=self._input_limit.ended.popleft(),
                                  detail="sends too much to the publications")

    def restore_files(self) -> None:
        """Bind again where a socket's file was removed, as a log-out does with its folder."""
        both = self._router, self._publisher
        if all(one.has_its_file() for one in both):
            self.unreachable = None
            return
        reasons = [reason for one in both if (reason := one.restore_file())]
        before, self.unreachable = self.unreachable, "; ".join(reasons) or None
        if self.unreachable is None:
            _log.warning("the socket's file was gone: listening again", address=self.address)
        elif self.unreachable != before:
            _log.error("nobody can connect, the socket's file is gone", address=self.address,
                       reason=self.unreachable)

    def rebind(self) -> None:
        """Listen again where connections were cut."""
        for one in (self._router, self._publisher):
            with suppress(AddressError):  # libzmq's own thread has not closed it yet
                one.bind()

    @property
    def guarded(self) -> bool:
        """Only allowed keys may connect."""
        return self._credentials is not None

    def count(self, key: str) -> int:
        """Give the number of connections by which messages of a key came, by its fingerprint."""
        return self._routing_ids.count(key)

    def end_silent(self) -> None:
        """End every connection by which nothing was said."""
        self._router.end_silent()
        self._publisher.end_silent()

    def disconnect_all(self) -> bool:
        """End every connection; those that are allowed come back.

        False where that was done already and the address is not yet bound again.
        """
        if not (self._router.bound or self._publisher.bound):
            return False
        self._router.cut()
        self._cut_publisher()
        return True

    def _cut_publisher(self) -> None:
        # First, as `unbind` would read what subscribers say for as long as more of it comes.
        for descriptor in self._subscribers.descriptors():
            end_connection(descriptor)
        self._publisher.cut()

    def _has_its_own_id(self, incoming: Incoming, first: zmq.Frame) -> bool:
        """Say whether a message's routing id is its sender's; note where it came from."""
        token, descriptor = incoming.peer[:_TOKEN_BYTES], _descriptor(first)
        new = not self._routing_ids.has_spoken(descriptor)
        if new:
            self._router.monitor.read()  # it may have connected after the last look
        if new and self.guarded and self._routing_ids.count(incoming.key) >= MAX_CONNECTIONS:
            end_connection(descriptor)
            self._rejections.note("connections", key=incoming.sender.name,
                                  address=incoming.address, detail="too many of one key")
            return False
        if self._routing_ids.claim(first.bytes, incoming.key, token, descriptor):
            return True
        self._rejections.note(
            "identity", key=incoming.sender.name, address=incoming.address,
            detail="calls itself as another key's connection does")
        return False

    def _is_connected(self, peer: bytes) -> bool:
        """Say whether a peer's own connection is still open: its id may be another's by now."""
        return self._routing_ids.is_open(peer[_TOKEN_BYTES:], peer[:_TOKEN_BYTES])

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

    def _read_subscription(self, frame: zmq.Frame) -> None:
        action, name = frame.bytes[:1], frame.bytes[1:].decode("utf-8", "replace")
        # For each frame that is no subscription libzmq passes over a connection that sent one.
        nonsense = action not in (_SUBSCRIBES, _UNSUBSCRIBES)
        self._mixed_up = self._mixed_up or nonsense
        descriptor = _descriptor(frame)
        if not self._subscribers.is_open(descriptor):
            # libzmq says what ends with a connection, or the connection has ended. Or of a flood
            # it was not read yet that it began: who connects again is heard.
            if self._publisher.monitor.behind:
                end_connection(descriptor)
            return
        topic = Topic(name) if name in set(Topic) else None
        if nonsense:
            self._end(descriptor, frame, "malformed", "sent to the publications")
        elif self._mixed_up:
            # It would be another's. Who connects again is taken for who it is.
            self._subscribers.closed(descriptor)
            end_connection(descriptor)
        elif action == _UNSUBSCRIBES:
            if topic:
                self._subscribers.unsubscribe(descriptor, topic)
                self._publisher.socket.set(zmq.UNSUBSCRIBE, topic.encode())
        elif user := self._allowed_user(frame):
            self._subscribe(user, topic, descriptor, frame)

    def _subscribe(
        self, user: AllowedKey, topic: Topic | None, descriptor: int, frame: zmq.Frame
    ) -> None:
        if topic is None:
            if self._subscribers.name_unknown(descriptor):
                self._rejections.note("malformed", key=user.name, address=_address(frame),
                                      detail=f"no topic {frame.bytes[1:33]!r}")
            else:
                self._end(descriptor, frame, "subscriptions", "too many topics that do not exist")
        elif not user.roles & ROLES_BY_TOPIC[topic]:
            self._rejections.note("role", key=user.name, address=_address(frame),
                                  detail=f"topic {topic}")
        elif self._subscribers.subscribe(
                descriptor, user.token if self._credentials else b"", topic):
            self._publisher.socket.set(zmq.SUBSCRIBE, topic.encode())
        else:
            self._end(descriptor, frame, "subscriptions", "too many connections of one key")

    def _end(self, descriptor: int, frame: zmq.Frame, reason: str, detail: str) -> None:
        """End a subscriber's connection and say why."""
        self._subscribers.closed(descriptor)
        end_connection(descriptor)
        user = self._user(frame)
        self._rejections.note(reason, key=user.name if user else None, address=_address(frame),
                              detail=detail)


def _property(frame: zmq.Frame, name: str) -> str:
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return ""


def _address(frame: zmq.Frame) -> str:
    return _property(frame, "Peer-Address") or "local"


def _descriptor(frame: zmq.Frame) -> int:
    """Give the connection by which a frame came, -1 where libzmq does not know it.

    It does not where the other end had gone before it looked, or where it made the frame itself.
    """
    return int(_property(frame, "__fd") or -1)
