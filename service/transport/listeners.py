"""All doors of the hub, and the one authenticator before the guarded ones."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import zmq

from denseface.service.errors import AddressError, AuthenticatorStoppedError
from denseface.service.monitoring.rejections import Rejections
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Buffer
from denseface.service.runtime.descriptors import DescriptorWatch
from denseface.service.runtime.memory import MemoryWatch
from denseface.service.security.allow_list import Allowed, AllowList
from denseface.service.security.keys import HUB, read_pair
from denseface.service.security.permissions import TOPICS
from denseface.service.security.zap import TOPICS_DOMAIN, Authenticator
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_bindable, is_local, socket_file
from denseface.service.transport.listener import Guard, Incoming, Listener

__all__ = ["Listeners", "guard", "guarded_addresses"]


class _Wakes(Protocol):
    def fileno(self) -> int: ...


class Listeners:
    """Opens every door that the settings name.

    Raises
    ------
    AddressError, KeyFileError, HubRunningError
        Where a door cannot be opened, or other machines could reach it and there are no keys.
    """

    def __init__(
        self, context: "zmq.Context[zmq.Socket[bytes]]", settings: ServiceSettings,
        refusals: Rejections, wakes: Sequence[_Wakes],
    ) -> None:
        self._keyring: AllowList | None = None
        self._changes = 0
        self._authenticator: Authenticator | None = None
        self._doors: list[Listener] = []
        self._refusals = refusals
        self._memory = MemoryWatch(settings.memory_mb << 20)
        self._descriptors = DescriptorWatch()
        self._poller = zmq.Poller()
        for one in wakes:
            self._poller.register(one, zmq.POLLIN)
        try:
            guarded = guarded_addresses(settings)
            if settings.address not in guarded:
                check_bindable(settings.address)
                self._doors.append(Listener(context, settings.address, None, refusals))
            if guarded:
                keys = guard(settings)
                self._keyring = keys.keyring
                self._authenticator = Authenticator(context, keys.keyring, refusals, _admits)
                self._poller.register(self._authenticator.socket, zmq.POLLIN)
                self._doors += [Listener(context, one, keys, refusals) for one in guarded]
        except BaseException:
            self.close()
            raise
        for door in self._doors:
            for socket in door.sockets:
                self._poller.register(socket, zmq.POLLIN)

    @property
    def addresses(self) -> list[str]:
        """Where the hub listens."""
        return [door.address for door in self._doors]

    def close(self) -> None:
        """Close all doors; the authenticator last."""
        for door in self._doors:
            door.close()
        if self._authenticator:
            self._authenticator.close()
        self._memory.close()

    def tick(self) -> bool:
        """Look at the allow-list; True where peers may have been cut off."""
        if self._keyring is None:
            return False
        self._keyring.refresh()
        changed = self._keyring.changes != self._changes
        self._changes = self._keyring.changes
        for door in self._doors:
            door.cut_revoked()
        if used := self._memory.beyond():
            self._cut_all("memory", f"{used >> 20} MB in use")
        if used := self._descriptors.beyond():
            self._cut_all("connections", f"{used} descriptors in use")
        else:  # libzmq ends the process where it has no descriptor to bind with
            for door in self._doors:
                door.bind_again()
        return changed

    def _cut_all(self, reason: str, detail: str) -> None:
        cut = [door.cut_all() for door in self._doors]
        if any(cut):
            self._refusals.note(reason, detail=f"{detail}: all connections from others are cut")

    def receive(self, timeout_ms: int) -> Iterator[Incoming]:
        """Wait, then give the messages that have come.

        Raises
        ------
        AuthenticatorStoppedError
            Nobody could be let in any more; libzmq refuses all until the hub is started again.
        """
        if self._authenticator and self._authenticator.socket.closed:
            raise AuthenticatorStoppedError("the authenticator has stopped: nobody can come in")
        ready = dict(self._poller.poll(timeout_ms))
        if self._keyring and ready:
            self._keyring.refresh()  # what was revoked a moment ago is refused already
        if self._authenticator and self._authenticator.socket in ready:
            self._authenticator.answer()
        for number, door in enumerate(self._doors):
            router, *others = door.sockets
            if router in ready:
                for one in door.receive():
                    yield replace(one, peer=bytes([number]) + one.peer)
            if any(one in ready for one in others):
                door.listen()

    def send(self, peer: bytes, parts: Sequence[Buffer]) -> bool:
        """Send to a peer; False where it cannot be reached, or its key was revoked."""
        return self._doors[peer[0]].send(peer[1:], parts)

    def publish(self, topic: Topic, parts: Sequence[Buffer]) -> bool:
        """Send to all who subscribed to a topic; False where one at least could not take it."""
        taken = [door.publish(topic, parts) for door in self._doors]
        return all(taken)

    def subscriptions(self) -> dict[str, int]:
        """Give how many subscriptions there are to each topic."""
        return {topic: sum(door.subscriptions[topic] for door in self._doors) for topic in Topic}

    def knows(self, peer: bytes) -> bool:
        """Say whether a peer's key is allowed still, with the roles that it had."""
        return self._doors[peer[0]].knows(peer[1:])


def guarded_addresses(settings: ServiceSettings) -> list[str]:
    """Give the addresses that only allowed keys may come to.

    Raises
    ------
    AddressError
        Where one of them is malformed.
    """
    for address in settings.listen:
        if socket_file(address):
            raise AddressError(f"{address}: --listen expects tcp://HOST:PORT")
    return [*settings.listen] if is_local(settings.address) else [
        settings.address, *settings.listen]


def guard(settings: ServiceSettings) -> Guard:
    """Read the hub's key and its allow-list.

    Raises
    ------
    AddressError
        Where there is no hub key, or no key is allowed: the doors stay shut.
    KeyFileError
        Where the hub's key cannot be used.
    """
    address = guarded_addresses(settings)[0]
    path = settings.key or settings.keys / f"{HUB}.secret"
    if not path.exists():
        raise AddressError(
            f"{address}: refused, it is not local to this machine: others are only let in with "
            f"CURVE security, and there is no hub key {path}; `denseface keys new {HUB}` makes one")
    keyring = AllowList(settings.keys)
    if not len(keyring):
        raise AddressError(
            f"{address}: refused, no key is allowed in {settings.keys / 'allowed'}; "
            "`denseface keys allow NAME KEY ROLE` lets one in")
    return Guard(read_pair(path), keyring)


def _admits(user: Allowed, domain: bytes) -> bool:
    return domain != TOPICS_DOMAIN or any(user.roles & needed for needed in TOPICS.values())
