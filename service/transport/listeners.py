"""All listeners of the hub, and the one authenticator of the guarded ones."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import zmq

from denseface.service.errors import AddressError, AuthenticatorStoppedError
from denseface.service.monitoring import Rejections
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Buffer
from denseface.service.runtime.files import check_unwritable
from denseface.service.runtime.limits import MemoryWatch
from denseface.service.security import HUB_NAME, AllowedKey, AllowList, read_pair
from denseface.service.security.permissions import ROLES_BY_TOPIC
from denseface.service.security.zap import PUBLICATIONS_DOMAIN, Authenticator
from denseface.service.settings import ServiceSettings
from denseface.service.transport._bound_socket import ServerCredentials
from denseface.service.transport._descriptor_guard import DescriptorGuard
from denseface.service.transport._key_limits import MAX_CONNECTIONS, KeyLimits
from denseface.service.transport.addresses import check_bindable, is_local, socket_file
from denseface.service.transport.listener import Incoming, Listener
from denseface.service.transport.sockets import Context


class _Pollable(Protocol):
    def fileno(self) -> int: ...


class Listeners:
    """Listens at every address that the settings name; `receive` waits for `wakes` too.

    AddressError, KeyFileError or HubRunningError where an address cannot be had, or other machines
    could reach it and there are no keys.
    """

    def __init__(
        self, context: Context, settings: ServiceSettings, rejections: Rejections,
        wakes: Sequence[_Pollable],
    ) -> None:
        self._allow_list: AllowList | None = None
        self._changes = 0
        self._authenticator: Authenticator | None = None
        self._listeners: list[Listener] = []
        self._rejections = rejections
        self._memory = MemoryWatch(settings.memory_mb << 20)
        self._descriptors = DescriptorGuard()
        self._key_limits = KeyLimits()
        self._poller = zmq.Poller()
        for pollable in wakes:
            self._poller.register(pollable, zmq.POLLIN)
        try:
            guarded = _guarded_addresses(settings)
            if settings.address not in guarded:
                check_bindable(settings.address)
                self._listeners.append(Listener(context, settings.address, None, rejections))
            if guarded:
                keys = server_credentials(settings)
                self._allow_list = keys.allow_list
                self._authenticator = Authenticator(
                    context, keys.allow_list, rejections, self._is_permitted, self._has_room)
                self._poller.register(self._authenticator.socket, zmq.POLLIN)
                self._listeners += [
                    Listener(context, address, keys, rejections) for address in guarded]
        except BaseException:
            self.close()
            raise
        for listener in self._listeners:
            for socket in listener.sockets:
                self._poller.register(socket, zmq.POLLIN)

    @property
    def addresses(self) -> list[str]:
        """Where the hub listens."""
        return [listener.address for listener in self._listeners]

    def unreachable(self) -> list[str]:
        """Give why nobody can connect at an address, for each where that is so."""
        return [one.unreachable for one in self._listeners if one.unreachable]

    def close(self) -> None:
        """Close all listeners; the authenticator last."""
        for listener in self._listeners:
            listener.close()
        if self._authenticator:
            self._authenticator.close()
        self._memory.close()
        self._descriptors.close()

    def tick(self) -> bool:
        """Apply changes of the allow-list and limits of memory and descriptors; see to the files.

        True where peers may have been cut off.
        """
        for listener in self._listeners:
            listener.restore_files()
        changed = False
        if self._allow_list:
            self._allow_list.refresh()
            changed = self._allow_list.changes != self._changes
            self._changes = self._allow_list.changes
        for listener in self._listeners:
            listener.tick()
        self._limit_memory()
        if ended := self._descriptors.take_ended():
            self._rejections.note(
                "connections", detail=f"{ended} beyond those that there are descriptors for: all "
                "that say nothing are ended")
            for listener in self._listeners:
                listener.end_silent()
        else:  # libzmq ends the process where it has no descriptor to bind with
            for listener in self._listeners:
                listener.rebind()
        return changed

    def _limit_memory(self) -> None:
        """Cut the connections of other machines; those of this one where that was too little."""
        used = self._memory.over_limit()
        guarded = [listener for listener in self._listeners if listener.guarded]
        if used and guarded:
            cut, whose = guarded, "from others"
        elif used or self._memory.cut_was_too_little:
            cut, whose = [one for one in self._listeners if not one.guarded], "from this machine"
        else:
            return
        if sum(listener.disconnect_all() for listener in cut):
            detail = f"{used >> 20} MB in use" if used else "too much is still in use"
            self._rejections.note("memory", detail=f"{detail}: all connections {whose} are cut")

    def receive(self, timeout_ms: int) -> Iterator[Incoming]:
        """Wait, then give the messages that have come.

        AuthenticatorStoppedError where libzmq refuses every new connection until the hub is started
        again.
        """
        if self._authenticator and self._authenticator.socket.closed:
            raise AuthenticatorStoppedError(
                "the authenticator has stopped: nobody can connect any more")
        ready = dict(self._poller.poll(timeout_ms))
        if self._allow_list and ready:
            self._allow_list.refresh_if_touched()  # so that a key revoked a moment ago is refused
        if self._authenticator and self._authenticator.socket in ready:
            self._authenticator.answer()
        for number, listener in enumerate(self._listeners):
            router, *others = listener.sockets
            if router in ready:
                for incoming in listener.receive():
                    yield replace(incoming, peer=bytes([number]) + incoming.peer)
            if any(socket in ready for socket in others):
                listener.read_events()

    def take_gone(self) -> Iterator[tuple[bytes, bool]]:
        """Give the peers whose connection has ended, and whether they were on this machine."""
        for number, listener in enumerate(self._listeners):
            for peer in listener.take_gone():
                yield bytes([number]) + peer, not listener.guarded

    def send(self, peer: bytes, parts: Sequence[Buffer]) -> bool:
        """Send to a peer; False where it cannot be reached, or its key was revoked."""
        return self._listeners[peer[0]].send(peer[1:], parts)

    def publish(self, topic: Topic, parts: Sequence[Buffer]) -> bool:
        """Send to all who subscribed to a topic; False where one at least could not take it."""
        taken = [listener.publish(topic, parts) for listener in self._listeners]
        return all(taken)

    def subscriptions(self) -> dict[str, int]:
        """Give the number of connections that are subscribed to each topic."""
        return {topic: sum(listener.subscriptions(topic) for listener in self._listeners)
                for topic in Topic}

    def is_allowed(self, peer: bytes) -> bool:
        """Say whether a peer's key is allowed still, with the roles that it had."""
        return self._listeners[peer[0]].is_allowed(peer[1:])

    def _has_room(self, user: AllowedKey, domain: bytes) -> bool:
        """Say whether a key may connect once more."""
        # Of publications the listener counts those that subscribe.
        if domain != PUBLICATIONS_DOMAIN and sum(
                one.count(user.fingerprint) for one in self._listeners) >= MAX_CONNECTIONS:
            return False
        return self._key_limits.take_handshake(user.public)

    def _is_permitted(self, user: AllowedKey, domain: bytes) -> bool:
        if domain != PUBLICATIONS_DOMAIN:
            return True
        for listener in self._listeners:
            # Before the answer, so that a connection is watched before it may say anything.
            listener.read_monitors()
        return any(user.roles & needed for needed in ROLES_BY_TOPIC.values())


def _guarded_addresses(settings: ServiceSettings) -> list[str]:
    """Give the addresses to which only allowed keys may connect; AddressError if malformed."""
    for address in settings.listen:
        if socket_file(address):
            raise AddressError(f"{address}: --listen expects tcp://HOST:PORT")
    own = [] if is_local(settings.address) else [settings.address]
    return [*own, *settings.listen]


def server_credentials(settings: ServiceSettings) -> ServerCredentials:
    """Read the hub's key pair and its allow-list.

    AddressError where there is no hub key or no key is allowed, KeyFileError where the hub's key
    cannot be used, SettingsError where others may change who is allowed.
    """
    address = _guarded_addresses(settings)[0]
    path = settings.key or settings.keys / f"{HUB_NAME}.secret"
    if not path.exists():
        raise AddressError(
            f"{address}: refused, it is not local to this machine: others connect with CURVE "
            f"security alone, and there is no hub key {path}; `denseface keys new {HUB_NAME}` "
            "makes one")
    allow_list = AllowList(settings.keys)
    if not len(allow_list):
        raise AddressError(
            f"{address}: refused, no key is allowed in {settings.keys / 'allowed'}; "
            "`denseface keys allow NAME KEY ROLE` allows one")
    for folder in (settings.keys, settings.keys / "allowed"):
        check_unwritable(folder)
    return ServerCredentials(read_pair(path), allow_list)
