"""The hub's process: sockets and clock; what is decided is decided in `service.hub`."""

import math
import os
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any

import structlog
import zmq

from denseface.recon.numerics.malloc import keep_freed_memory
from denseface.recon.settings import Settings
from denseface.service.daemons.opening import Opening
from denseface.service.errors import LocalProtocolError, RemoteProtocolError
from denseface.service.hub import Hub
from denseface.service.monitoring import Observer, Rejections
from denseface.service.monitoring.observer import Snapshot
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.outgoing import Output, Publish, send, steps
from denseface.service.protocol.status import Restarts
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Buffer, Packet, encode
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.security.permissions import OF_ITS_OWN, missing_role
from denseface.service.settings import ServiceSettings
from denseface.service.storage import OpeningStore, WriterThreads, kept_bytes
from denseface.service.transport.listener import Incoming
from denseface.service.transport.listeners import Listeners

__all__ = ["run"]

_TICK_S = 0.25
"""Longest time between two ticks of the hub, seconds."""
_SENT_FAILPOINTS = {
    "take": "hub.take.sent", "frame_accepted": "hub.frame.acknowledged",
    "press_accepted": "hub.press.acknowledged", "job": "hub.job.sent"}
"""Failpoint that is passed after a message of this kind was sent."""
_log = structlog.get_logger("hub")


def run(settings: ServiceSettings, recon: Settings,
        supervisor: SupervisorLink | None = None) -> int:
    """Serve until SIGINT or SIGTERM and give the exit status.

    Raises
    ------
    AddressError, KeyFileError, HubRunningError, StoreError
        Where an address or the data folder cannot be had.
    AuthenticatorStoppedError
        Where no connection can be authenticated any more.
    """
    os.umask(0o077)  # SQLite's files too are for this user alone
    keep_freed_memory()  # fetching it anew for each face costs a third of the processor time
    with StopSignal() as stop, OpeningStore(settings.data) as opening, \
            WriterThreads() as writer, Observer(partial(kept_bytes, settings.data)) as observer, \
            zmq.Context() as context:
        rejections = Rejections(observer.figures.counters)
        supervisor = supervisor or SupervisorLink()
        wakes = stop, opening, writer
        with closing(Listeners(context, settings, rejections, wakes)) as listeners, \
                _metrics_server(settings, observer):
            _log.info("listening", address=" ".join(listeners.addresses), data=str(settings.data))
            before = Opening(listeners, opening, rejections, supervisor)
            if store := before.wait(stop):
                hub = Hub(store, settings, recon, observer.figures, rejections, writer,
                          time.monotonic())
                _EventLoop(
                    listeners, hub, rejections, observer, writer, supervisor, before.refuse
                ).serve(stop, before.waiting())
        _log.info("stopped")
        return stop.exit_status


def _metrics_server(settings: ServiceSettings, observer: Observer) -> AbstractContextManager[Any]:
    if settings.metrics is None:
        return nullcontext()
    from prometheus_client import make_wsgi_app

    from denseface.service.monitoring.health import Health, write_error
    from denseface.service.monitoring.http_server import MetricsServer
    from denseface.service.monitoring.prometheus import Metrics

    health = Health(observer.latest, settings, lambda: write_error(settings.data))
    server = MetricsServer(settings.metrics, make_wsgi_app(Metrics(observer.latest).registry),
                           health.report)
    _log.info("metrics", url=f"{server.url}/metrics")
    return server


@dataclass(frozen=True)
class _EventLoop:
    listeners: Listeners
    hub: Hub
    rejections: Rejections
    observer: Observer
    writer: WriterThreads
    supervisor: SupervisorLink
    refuse: Callable[[Incoming, RemoteProtocolError], None]
    """Tells the sender of a malformed message what is wrong with it."""

    def serve(self, stop: StopSignal, waiting: Sequence[Incoming]) -> None:
        """Serve until told to stop, first what has come before there was a hub."""
        due = time.monotonic()
        for incoming in waiting:
            self._receive(incoming)
        while not stop:
            if (now := time.monotonic()) >= due:
                due = self._tick(now, due)
            elif now >= self.hub.due():
                self._send_all(self.hub.act(now))
            wait_s = min(due, self.hub.due()) - now
            for incoming in self.listeners.receive(max(0, math.ceil(wait_s * 1000))):
                self._receive(incoming)
            for peer, local in self.listeners.take_gone():
                self._send_all(self.hub.connection_ended(peer, local=local))
            if self.writer.has_results():
                self._send_all(self.hub.written(time.monotonic()))
            stop.drain()
        self.supervisor.manager.stopping()
        # Writes under way are finished and acknowledged; the sockets linger for that.
        self._send_all(self.hub.written(time.monotonic(), wait=True))

    def _tick(self, now: float, due: float) -> float:
        """Let the hub do what time demands; give when the next tick is due."""
        self.supervisor.beat()
        if (counts := self.supervisor.restarts()) is not None:
            self.observer.figures.restarts = {
                name: Restarts.model_validate(by_reason) for name, by_reason in counts.items()}
        self.hub.loop_stalled(now - due)
        subscriptions = self.listeners.subscriptions()
        if self.listeners.tick():
            self._drop_revoked()
        self.hub.want_previews(wanted=subscriptions[Topic.PREVIEW] > 0)
        self.hub.want_hints(wanted=subscriptions[Topic.HINTS] > 0)
        self.hub.status_subscribers(subscriptions[Topic.STATUS])
        outputs = self.hub.tick(now)
        self.observer.record_tick(now, outputs, subscriptions, self.listeners.unreachable())
        self.supervisor.manager.ready(_in_short(self.observer.latest()))
        self._send_all(outputs)
        return now + _TICK_S

    def _drop_revoked(self) -> None:
        for peer in self.hub.peers():
            if not self.listeners.is_allowed(peer):
                self._send_all(self.hub.unreachable(peer, "its key or its roles changed"))

    def _receive(self, incoming: Incoming) -> None:
        try:
            packet = incoming.packet()
        except RemoteProtocolError as error:
            self.refuse(incoming, error)
            return
        message, sender = packet.message, incoming.sender
        own = (incoming.key != "" and isinstance(message, OF_ITS_OWN)
               and self.hub.pressed_by(message.capture_id) == incoming.key)
        missing = missing_role(sender.roles, message, own=own)
        if missing:
            self.rejections.note(
                "role", key=sender.name, address=incoming.address, detail=missing)
            self._send_all([_denied(incoming, message, missing)])
            return
        self._send_all(self.hub.receive(
            time.monotonic(), incoming.peer, packet, incoming.key, sender.roles), packet)

    def _send_all(self, outputs: list[Output], caused_by: Packet | None = None) -> None:
        for step in steps(outputs):
            self.observer.watch.record(time.monotonic(), caused_by, step)
            self._send(step)
            caused_by = None

    def _send(self, outputs: Sequence[Output]) -> None:
        for output in outputs:
            try:
                parts = encode(output.packet)
            except LocalProtocolError as error:  # the hub goes on without it
                _log.error("message not sent", reason=str(error))
                continue
            if isinstance(output, Publish):
                self._publish(output.topic, parts)
            elif not self.listeners.send(output.peer, parts):
                self._send_all(self.hub.unreachable(output.peer))
            elif name := _SENT_FAILPOINTS.get(output.packet.message.kind):
                failpoint(name)

    def _publish(self, topic: Topic, parts: Sequence[Buffer]) -> None:
        if topic is Topic.FACES:
            failpoint("hub.outcome.publishing")
        if not self.listeners.publish(topic, parts):
            self.observer.figures.counters.add("drops", topic)
        if topic is Topic.FACES:
            failpoint("hub.outcome.published")


def _in_short(snapshot: Snapshot | None) -> str:
    """Say in one line who is there."""
    if snapshot is None:
        return "listens"
    status = snapshot.status
    return f"sensors: {len(status.sensors)}, workers: {len(status.workers)}"


def _denied(incoming: Incoming, message: BaseMessage, missing: str) -> Output:
    """Give the one line that tells a sender which role its key lacks."""
    has = ", ".join(sorted(incoming.sender.roles))
    text = f"refused: {missing}, the key {incoming.sender.name} has {has}"
    request = getattr(message, "request", None)
    return send(incoming.peer, messages.Denied(message=text) if request is None
                else messages.RequestFailed(request=request, message=text))
