"""A daemon's connection to the hub: messages, heartbeats, waiting."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Self

import structlog
import zmq

from denseface.service.errors import ProtocolError
from denseface.service.protocol.message_base import ToHub
from denseface.service.protocol.messages import Denied, Goodbye, Heartbeat
from denseface.service.protocol.payload import Arrays
from denseface.service.protocol.wire import Packet, encode
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.runtime.watching.supervisor_link import Beat, SupervisorLink
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_connectable
from denseface.service.transport.connection import Credentials, connect, receive_packet
from denseface.service.transport.sockets import Context, send_parts

_RETRY_S = 0.1
"""Interval between heartbeats while the hub is not there, seconds."""
_SAY_ALONE_S = 1.0
"""Time without a connection until that is said, seconds."""


class HubConnection:
    """Sends heartbeats by itself while `packets` waits, also to the supervisor; says goodbye."""

    def __init__(
        self, settings: ServiceSettings, name: str, supervisor: SupervisorLink | None = None
    ) -> None:
        check_connectable(settings.address)
        keys = Credentials.of(settings)
        self._heartbeat_s = settings.heartbeat_s
        self._supervisor = supervisor or SupervisorLink()
        self._supervisor.manager.need(settings.silence_s)  # it is as silent between heartbeats
        self._log = structlog.get_logger(name)
        self._context: Context = zmq.Context()
        self._socket, self._monitor = connect(self._context, zmq.DEALER, settings.address, keys)
        self._denied = ""
        self._address = settings.address
        self._alone_since: float | None = time.monotonic()
        """Since when there is no connection, seconds; None while there is one."""
        self._said_alone = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.send(Goodbye())
        self._context.destroy()

    def send(self, message: ToHub, arrays: Arrays | None = None) -> bool:
        """Send without waiting; False where the hub is not there."""
        return send_parts(self._socket, encode(Packet(message, arrays or {})))

    def packets(
        self, stop: StopSignal, wake: WakePipe, heartbeat: Callable[[], Heartbeat] = Heartbeat
    ) -> Iterator[Packet | None]:
        """Give what the hub sends, and None at every heartbeat and when `wake` is readable.

        `stop` ends the iteration; `heartbeat` gives what this process says of itself.
        """
        poller = zmq.Poller()
        for readable in (self._socket, stop, wake):
            poller.register(readable, zmq.POLLIN)
        due = 0.0
        while not stop:
            if (now := time.monotonic()) >= due:
                said = heartbeat()
                self._supervisor.beat(Beat.HOLDING if said.holding else Beat.IDLE)
                sent = self.send(said)
                due = now + (self._heartbeat_s if sent else min(_RETRY_S, self._heartbeat_s))
                if self._monitor.read():
                    self._log.error("refused by the hub", reason=str(self._monitor.refused))
                self._log_connection(now)
                yield None
            ready = dict(poller.poll(max(0, math.ceil((due - time.monotonic()) * 1000))))
            if stop.fileno() in ready:
                stop.drain()
            elif self._socket in ready:
                try:
                    packet = receive_packet(self._socket)
                except ProtocolError as error:
                    self._log.warning("message dropped", reason=str(error))
                    continue
                if isinstance(packet.message, Denied):
                    self._log_denied(packet.message.message)
                else:
                    yield packet
            elif wake.fileno() in ready:
                wake.drain()
                yield None
        self._supervisor.manager.stopping()

    def _log_connection(self, now: float) -> None:
        """Say once that the hub is waited for, and that it is there after that."""
        if self._monitor.connected:
            if self._said_alone:
                self._log.info("connected to the hub", address=self._address)
            self._alone_since, self._said_alone = None, False
        elif self._alone_since is None:
            self._alone_since = now
        elif not self._said_alone and now - self._alone_since >= _SAY_ALONE_S:
            self._said_alone = True
            self._supervisor.manager.status(f"waits for the hub at {self._address}")
            if not self._monitor.refused:  # that has been said
                self._log.warning("waiting for the hub", address=self._address,
                                  reason=self._monitor.why_not())

    def _log_denied(self, reason: str) -> None:
        if reason != self._denied:  # once, not at every heartbeat
            self._log.error("denied", reason=reason)
            self._denied = reason
