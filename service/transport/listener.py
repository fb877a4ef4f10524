"""One place where the hub listens: a local door without keys, or a guarded one.

A door is a ROUTER for messages and an XPUB for publications. A guarded one has CURVE, an
authenticator without which nobody comes in, and an allow-list that is asked again at each message:
a key that is revoked is cut off at once.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import zmq

from denseface.service.errors import AddressError
from denseface.service.monitoring.rejections import Rejections
from denseface.service.protocol.payload import MAX_PAYLOAD_BYTES
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import MAX_HEADER_BYTES, MAX_PARTS, Buffer
from denseface.service.security.allow_list import AllowedKey, AllowList
from denseface.service.security.keys import KeyPair
from denseface.service.security.permissions import ALL_ROLES, ROLES_BY_TOPIC
from denseface.service.security.zap import MESSAGES_DOMAIN, PUBLICATIONS_DOMAIN
from denseface.service.transport.addresses import publications_of, socket_file
from denseface.service.transport.handshakes import HandshakeMonitor
from denseface.service.transport.sockets import (
    TooLongError,
    open_socket,
    publish_parts,
    receive_parts,
    send_parts,
)

__all__ = ["Incoming", "Listener", "ServerCredentials"]

_TOKEN_BYTES = 8
_LOCAL = bytes(_TOKEN_BYTES)
_MAX_SUBSCRIPTION_BYTES = 1024
"""MAXMSGSIZE of an XPUB; a handshake is as long."""
_HANDSHAKE_MS = 10_000
_FLOOD = 100
"""Messages of revoked keys between two ticks for which all connections are cut."""
_BURST = 32
"""Messages taken from one socket between two looks at the clock."""


@dataclass(frozen=True)
class ServerCredentials:
    """What a guarded door needs."""

    pair: KeyPair
    """The hub's own."""
    allow_list: AllowList


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


_ANYONE = AllowedKey("", "", ALL_ROLES)
"""Whoever came by the local door."""


class Listener:
    """Binds both sockets of one address.

    Parameters
    ----------
    credentials : where None, whoever can open the address has every role

    Raises
    ------
    AddressError
        Where the address cannot be had.
    """

    def __init__(
        self, context: "zmq.Context[zmq.Socket[bytes]]", address: str,
        credentials: ServerCredentials | None, rejections: Rejections,
    ) -> None:
        self.address = address
        self._credentials = credentials
        self._rejections = rejections
        self._monitors: list[HandshakeMonitor] = []
        self._subscribed: set[bytes] = set()
        """Tokens of the keys that subscribed since the publisher was bound."""
        self._revoked = 0
        """Messages with keys that are allowed no more, since the last tick."""
        self._unbound: dict[zmq.Socket[bytes], str] = {}
        """What is to be bound again, where its connections were cut."""
        self.subscriptions: dict[Topic, int] = dict.fromkeys(Topic, 0)
        """How many there are of each topic."""
        self._router = open_socket(context, zmq.ROUTER, address)
        self._router.set(zmq.ROUTER_MANDATORY, 1)
        self._publisher = open_socket(context, zmq.XPUB, address)
        self._publisher.set(zmq.XPUB_MANUAL, 1)
        self._publisher.set(zmq.MAXMSGSIZE, _MAX_SUBSCRIPTION_BYTES)
        try:
            for socket, one, domain in ((self._router, address, MESSAGES_DOMAIN),
                                        (self._publisher, publications_of(address),
                                         PUBLICATIONS_DOMAIN)):
                self._bind(socket, one, domain)
        except BaseException:
            self.close()
            raise

    @property
    def sockets(self) -> "list[zmq.Socket[bytes]]":
        """What is to be polled for reading."""
        return [self._router, self._publisher, *(one.socket for one in self._monitors)]

    def close(self) -> None:
        """Unbind and leave no file behind."""
        for monitor in self._monitors:
            monitor.close()
        self._router.close()
        self._publisher.close()
        for address in (self.address, publications_of(self.address)):
            if path := socket_file(address):
                path.unlink(missing_ok=True)

    def receive(self) -> Iterator[Incoming]:
        """Give the messages that have come, a burst of them at most."""
        for _ in range(_BURST):
            try:
                first, parts = receive_parts(
                    self._router, MAX_PARTS, MAX_HEADER_BYTES + MAX_PAYLOAD_BYTES)
            except zmq.Again:
                return
            except TooLongError as error:
                user = self._user(error.first)
                self._rejections.note("oversized", key=user.name if user else None,
                                    address=_address(error.first), detail=str(error))
                continue
            if user := self._known(first):
                token, key = (user.token, user.fingerprint) if self._credentials else (_LOCAL, "")
                yield Incoming(token + first.bytes, [part.buffer for part in parts], user, key,
                               _address(first))

    def read_events(self) -> None:
        """Take note of who subscribes, of who leaves and of who was not let in."""
        for monitor in self._monitors:
            monitor.read()
        for _ in range(_BURST):
            try:
                first, _ = receive_parts(self._publisher, 0, 0)
            except zmq.Again:
                return
            except TooLongError as error:
                self._rejections.note("malformed", address=_address(error.first),
                                    detail="sent to the publications")
                continue
            self._subscription(first)

    def send(self, peer: bytes, parts: Sequence[Buffer]) -> bool:
        """Send to a peer; False where it cannot be reached, or its key was revoked."""
        if not self.is_allowed(peer):
            return False
        try:
            return send_parts(self._router, [peer[_TOKEN_BYTES:], *parts])
        except zmq.ZMQError as error:
            if error.errno != zmq.EHOSTUNREACH:
                raise
            return False

    def publish(self, topic: Topic, parts: Sequence[Buffer]) -> bool:
        """Send to all who subscribed to a topic; False where one at least could not take it."""
        return publish_parts(self._publisher, [topic.encode(), *parts])

    def is_allowed(self, peer: bytes) -> bool:
        """Say whether a peer's key is allowed still, with the roles that it had."""
        token = peer[:_TOKEN_BYTES]
        if self._credentials is None:
            return token == _LOCAL
        return self._credentials.allow_list.has_token(token)

    def disconnect_revoked(self) -> None:
        """Cut off the keys that are allowed no more, if they subscribed or do not fall silent."""
        if self._revoked > _FLOOD:
            self._unbind(self._router)
        self._revoked = 0
        if self._credentials and not all(
                map(self._credentials.allow_list.has_token, self._subscribed)):
            self._unbind(self._publisher)

    def rebind(self) -> None:
        """Open what was cut."""
        for socket, address in list(self._unbound.items()):
            # Not free before libzmq's own thread has closed it: tried again at the next tick.
            with suppress(zmq.ZMQError):
                socket.bind(address)
                del self._unbound[socket]

    def disconnect_all(self) -> bool:
        """End every connection from another machine; those that may come back will.

        False where that was done already and the door is not yet open again.
        """
        if self._credentials is None or len(self._unbound) == 2:
            return False
        for socket in (self._router, self._publisher):
            self._unbind(socket)
        for monitor in self._monitors:
            monitor.forget()
        return True

    def _unbind(self, socket: "zmq.Socket[bytes]") -> None:
        """End all connections of a socket: one alone cannot be.

        The others come back by themselves in less than a second, pass the authenticator again and
        fetch what they missed.
        """
        if socket not in self._unbound:
            address = socket.get_string(zmq.LAST_ENDPOINT).rstrip("\0")
            socket.unbind(address)
            self._unbound[socket] = address
        if socket is self._publisher:
            self._subscribed.clear()

    def _bind(self, socket: "zmq.Socket[bytes]", address: str, domain: bytes) -> None:
        if self._credentials:
            socket.set(zmq.CURVE_SERVER, 1)
            socket.set(zmq.CURVE_SECRETKEY, self._credentials.pair.secret.encode())
            socket.set(zmq.ZAP_ENFORCE_DOMAIN, 1)
            socket.set(zmq.ZAP_DOMAIN, domain)
            socket.set(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
            if socket is self._publisher:
                socket.set(zmq.LINGER, 0)  # nothing more for a key that is cut off
            self._monitors.append(HandshakeMonitor(socket, self._rejections))
        try:
            socket.bind(address)
        except zmq.ZMQError as error:
            raise AddressError(f"{address}: {zmq.strerror(error.errno or 0)}") from error

    def _user(self, first: zmq.Frame) -> AllowedKey | None:
        if self._credentials is None:
            return _ANYONE
        return self._credentials.allow_list.get(_property(first, "User-Id"))

    def _known(self, first: zmq.Frame) -> AllowedKey | None:
        user = self._user(first)
        if user is None:
            self._revoked += 1
            self._rejections.note("revoked key", address=_address(first),
                                key=_property(first, "User-Id"))
        return user

    def _subscription(self, first: zmq.Frame) -> None:
        said = first.bytes
        name = said[1:].decode("utf-8", "replace")
        topic = Topic(name) if name in set(Topic) else None
        if topic and said[:1] in (b"\0", b"\1"):
            # Of those not let in too: their end is told as well, without a name.
            self.subscriptions[topic] = max(
                0, self.subscriptions[topic] + (1 if said[:1] == b"\1" else -1))
        if said[:1] == b"\0":
            if topic:
                self._publisher.set(zmq.UNSUBSCRIBE, topic.encode())
            return
        user = self._known(first)
        if user is None:
            return
        if said[:1] != b"\1" or topic is None:
            self._rejections.note("malformed", key=user.name, address=_address(first),
                                detail=f"no topic {name[:32]!r}")
        elif not user.roles & ROLES_BY_TOPIC[topic]:
            self._rejections.note("role", key=user.name, address=_address(first),
                                detail=f"topic {topic}")
        else:
            self._subscribed.add(user.token)
            self._publisher.set(zmq.SUBSCRIBE, topic.encode())


def _property(frame: zmq.Frame, name: str) -> str:
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return ""


def _address(frame: zmq.Frame) -> str:
    return _property(frame, "Peer-Address") or "local"
