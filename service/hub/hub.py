"""The hub without sockets: messages and the time in, messages out.

Nothing here waits, sends or reads a clock, so every order of events can be tested. What a message
says to be safe is in the store before the message is returned. The life of a capture is the table
in `service.protocol.states`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

import structlog

from denseface.recon.settings import Settings
from denseface.service import errors, storage
from denseface.service.hub._common import LOCAL, Common
from denseface.service.hub.captures import Captures
from denseface.service.hub.jobs import Jobs
from denseface.service.hub.maintenance import Maintenance
from denseface.service.hub.outcomes import Outcomes
from denseface.service.hub.peers import Peers, WorkerPeer
from denseface.service.hub.presses import Presses
from denseface.service.hub.previews import Hints, Previews
from denseface.service.hub.sensors import SensorPeer, names_of
from denseface.service.hub.status_report import StatusReport
from denseface.service.monitoring import Figures, Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, send
from denseface.service.protocol.roles import Role
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.security.permissions import ALL_ROLES
from denseface.service.settings import ServiceSettings

_WRITES_S = 1.0
"""Longest time for which a removal holds the hub up for files that are being written, seconds."""


class Hub:
    """Takes presses, saves frames, sends jobs, publishes outcomes.

    Parameters
    ----------
    store : captures; what is unfinished in it is resumed
    settings : time-outs and limits
    recon : settings of every job accepted from now on
    figures : counts and latencies for the status
    rejections : counts what was refused
    writer : writes the files; each call takes what it has finished
    opened : when sensors could reach the hub at last, seconds of the clock of `now`
    """

    def __init__(
        self, store: storage.FolderStore, settings: ServiceSettings, recon: Settings,
        figures: Figures | None = None, rejections: Rejections | None = None,
        writer: storage.Writer | None = None, opened: float = -math.inf,
    ) -> None:
        self._store = store
        self._writer = writer or storage.InlineWriter()
        self._figures = figures or Figures()
        self._rejections = rejections or Rejections(self._figures.counters)
        self._settings = settings
        self._peers = Peers()
        self._captures = Captures(store)
        common = Common(store, self._captures, self._writer, self._peers, settings)
        self._outcomes = Outcomes(store, self._requeue_damaged)
        self._jobs = Jobs(
            common, self._outcomes.publish, self._rejections, self._figures.counters)
        self._presses = Presses(
            common, recon, self._jobs.add, opened + settings.silence_s, self._rejections)
        self._maintenance = Maintenance(
            common, self._presses, self._jobs, self._outcomes, self._figures.counters)
        self._previews = Previews(self._peers, settings.heartbeat_s, self._rejections)
        self._hints = Hints(self._peers, settings.heartbeat_s)
        self._status = StatusReport(
            common, self._presses, self._jobs, self._figures, self._rejections)
        self._log = structlog.get_logger("hub")

    def receive(
        self, now: float, peer: bytes, packet: Packet, key: str = "",
        roles: frozenset[Role] = ALL_ROLES,
    ) -> list[Output]:
        """Handle one message and return what to send.

        DamagedDatabaseError where the hub must end; the next one rebuilds the database.

        Parameters
        ----------
        now : seconds, of a monotonic clock
        peer : routing id of the sender's connection
        key : fingerprint of the sender's key; empty where it needed none
        roles : of that key
        """
        outputs: list[Output] = []
        try:
            outputs.extend(self._receive(now, peer, packet, key, roles))
            outputs.extend(self._process_writes(now))
            outputs.extend(self._status.tell_changes(now))
        except errors.DamagedDatabaseError:
            raise
        except errors.ServiceError as error:
            self._log.error("message failed", kind=packet.message.kind, reason=str(error),
                            key=key or LOCAL)
            request = getattr(packet.message, "request", None)
            if request is not None:
                outputs.append(send(peer, messages.RequestFailed(
                    request=request, message=str(error))))
        return outputs

    def written(self, now: float, *, wait: bool = False) -> list[Output]:
        """Give written files their rows and return what to send; raises as `receive`.

        With `wait`, until all that is being written has its row, and all that is being erased is
        gone; no job is sent then.
        """
        outputs: list[Output] = []
        try:
            if wait:
                self._writer.wait()
                outputs.extend(self._written(now, self._writer.take_results()))
                self._writer.wait(erased=True)
                outputs.extend(self._maintenance.erased(now, self._writer.take_erased()))
            else:
                outputs.extend(self._process_writes(now))
        except errors.DamagedDatabaseError:
            raise
        except errors.ServiceError as error:
            self._log.error("not saved", reason=str(error))
        return outputs

    def _process_writes(self, now: float) -> Iterator[Output]:
        """Take finished erasures and writes and send jobs, until none brings anything."""
        yield from self._maintenance.erased(now, self._writer.take_erased())
        written = self._writer.take_results()
        while True:
            yield from self._written(now, written)
            yield from self._jobs.dispatch(now)
            if not (written := self._writer.take_results()):
                return

    def _written(self, now: float, written: Sequence[storage.WriteResult]) -> Iterator[Output]:
        yield from self._presses.written(
            [one for one in written if isinstance(one.pending.metadata, storage.FrameMetadata)])
        yield from self._jobs.written(
            now, [one for one in written if isinstance(one.pending.metadata, storage.FaceMetadata)])

    def tick(self, now: float) -> list[Output]:
        """Handle time-outs, silent peers, removals and the status; raises as `receive`.

        To be called a few times a second.
        """
        outputs: list[Output] = []
        try:
            outputs.extend(self._presses.tick(now))
            outputs.extend(self._outcomes.tick(now))
            for peer in self._peers.silent(now - self._settings.silence_s):
                outputs.extend(self._disconnected(peer, "silent"))
            self._jobs.tick(now)
            outputs.extend(self._maintenance.tick(now))
            outputs.extend(self._process_writes(now))
            outputs.extend(self._hints.ask(now))
            outputs.extend(self._previews.ask(now, self._presses.asked_sensors()))
            outputs.extend(self._status.tick(now))
        except errors.DamagedDatabaseError:
            raise
        except errors.ServiceError as error:
            self._log.error("tick failed", reason=str(error))
        return outputs

    def loop_stalled(self, seconds: float) -> None:
        """Give peers the time by which a tick came late: what they said has not been read yet.

        The process was stopped, or waited for its disk.
        """
        if seconds < self._settings.heartbeat_s:  # less than a silent peer is allowed
            return
        self._log.warning("event loop was stalled", seconds=round(seconds, 1))
        self._peers.postpone_timeouts(seconds)

    def unreachable(self, peer: bytes, reason: str = "unreachable") -> list[Output]:
        """Remove a peer that cannot be reached any more."""
        return list(self._disconnected(peer, reason))

    def connection_ended(self, peer: bytes, *, local: bool) -> list[Output]:
        """Take note that a peer's connection has ended, after all that it said by it.

        A process of this machine has ended. A worker elsewhere may connect again, with the face
        that it makes: it gets no more jobs, and those that it has are its own until it is silent.
        """
        worker = self._peers.workers.get(peer)
        if local or worker is None:
            return list(self._disconnected(peer, "disconnected"))
        worker.away, worker.free = True, False
        self._status.note_change()
        return []

    def pressed_by(self, capture_id: str) -> str | None:
        """Give the fingerprint of the key that pressed a capture; None where there is none."""
        try:
            stored = self._store.find(capture_id)
        except errors.StoreError as error:
            self._log.error("presser not read", reason=str(error))
            return None
        return stored.pressed_by if stored else None

    def want_previews(self, *, wanted: bool) -> None:
        """Say whether anybody subscribes to previews: then the sensors are asked for them."""
        self._previews.wanted = wanted

    def want_hints(self, *, wanted: bool) -> None:
        """Say whether anybody subscribes to hints."""
        self._hints.wanted = wanted

    def status_subscribers(self, number: int) -> None:
        """Say how many subscribe to the status."""
        self._status.note_subscribers(number)

    def act(self, now: float) -> list[Output]:
        """Do what cannot wait for the next tick; to be called when `due`. Raises as `receive`."""
        outputs = list(self._previews.ask(now, self._presses.asked_sensors()))
        try:
            outputs.extend(self._status.tell_changes(now))
        except errors.DamagedDatabaseError:
            raise
        except errors.ServiceError as error:
            self._log.error("status not told", reason=str(error))
        return outputs

    def due(self) -> float:
        """Return when to `act`, seconds; infinite where nothing is to be done before a tick."""
        return min(self._previews.next_due(self._presses.asked_sensors()), self._status.due())

    def peers(self) -> list[bytes]:
        """Return the routing ids of all sensors and workers."""
        return [*self._peers.sensors, *self._peers.starting, *self._peers.workers]

    def _receive(
        self, now: float, peer: bytes, packet: Packet, key: str, roles: frozenset[Role]
    ) -> Iterator[Output]:
        match packet.message:
            case messages.Press() as message:
                yield from self._presses.press(now, peer, message, self._jobs.queued, key)
            case messages.GetFace() as message:
                yield from self._outcomes.get_face(now, peer, message, key)
            case messages.GetFrame() as message:
                yield from self._outcomes.get_frame(peer, message)
            case messages.GetNext() as message:
                yield from self._outcomes.get_next(peer, message)
            case messages.FindStart() as message:
                yield from self._outcomes.find_start(peer, message)
            case messages.ListCaptures() as message:
                yield send(peer, self._list(message))
            case messages.RestartSensor() as message:
                yield from self._restart(peer, message)
            case messages.ListDead() | messages.RetryDead() | messages.DropDead() as message:
                yield from self._maintenance.receive(peer, message)
            case messages.Purge() as message:
                yield from self._end_writes(now)
                yield from self._maintenance.receive(peer, message)
            case messages.Withdraw() as message:
                yield from self._withdraw(now, peer, message, key, roles)
            case messages.GetStatus(request=request):
                yield send(peer, self._status.make(request))
            case messages.SensorReady() | messages.SensorState() as message:
                yield from self._sensor_ready(now, peer, message, key)
            case messages.WorkerReady() as message:
                yield from self._worker_ready(now, peer, message, key)
            case messages.Heartbeat(compiling=messages.Compiling() as one) if Role.WORKER in roles:
                self._peers.worker_compiles(peer, one, now, key)
            case messages.Heartbeat(holding=holding):
                if not self._peers.heartbeat(peer, holding, now):
                    self._peers.ask_for_ready(peer)
                    yield send(peer, messages.Announce())
            case messages.Goodbye():
                if worker := self._peers.workers.get(peer):
                    self._jobs.hand_back(worker, [*worker.jobs])
                yield from self._disconnected(peer, "goodbye")
            case messages.Frame() as message:
                yield from self._presses.frame(now, peer, message, packet)
            case messages.PreviewFrame() as message:
                yield from self._previews.receive(peer, message, packet)
            case messages.QualityHint() as message:
                yield from self._hints.receive(now, peer, message)
            case messages.FrameFailed() as message:
                yield from self._presses.frame_failed(peer, message)
            case messages.Result() as message:
                self._jobs.result(now, peer, message, packet, key)
            case messages.JobFailed() as message:
                yield from self._jobs.failed(now, peer, message, key)

    def _withdraw(
        self, now: float, peer: bytes, message: messages.Withdraw, key: str,
        roles: frozenset[Role],
    ) -> Iterator[Output]:
        """Remove a capture of this key; of another's nothing is done, and nothing else is said."""
        capture_id, withdrawn = message.capture_id, self._presses.withdrawn
        operator = Role.OPERATOR in roles
        if not operator and not withdrawn.take_turn(key, now):
            raise errors.ServiceError("too many withdrawals with this key: again in a moment")
        owner = self._presses.pressed_by(capture_id)
        owned = owner in (None, key) or operator
        state = self._captures.state(capture_id) if owned else None
        if state in (CaptureState.SAVING_FRAME, CaptureState.SAVING_FACE):
            yield from self._end_writes(now)
        withdrawn.add(key, capture_id)
        if owned and owner is not None:
            withdrawn.add(owner, capture_id)
        self._log.info("withdrawn" if owned else "withdrawal of another key's capture ignored",
                       capture_id=capture_id, key=key or LOCAL)
        yield from self._maintenance.withdraw(peer, message, key, owned=owned)

    def _list(self, message: messages.ListCaptures) -> messages.CaptureList:
        """List captures with the states that they have now, which rows do not say of all."""
        return messages.CaptureList(request=message.request, captures=tuple(
            one.model_copy(update={"state": str(self._captures.state(one.capture_id))})
            for one in self._store.last_accepted(message.last)))

    def _restart(self, peer: bytes, message: messages.RestartSensor) -> Iterator[Output]:
        """Tell the sensors of a name to begin anew: of two with one, one is mostly dead already."""
        named = [one.peer for one in self._peers.sensors.values() if one.name == message.sensor]
        if not named:
            there = names_of(self._peers.sensors.values())
            raise errors.ServiceError(
                f"no sensor {message.sensor} is connected; there: {there}")
        self._log.info("sensor to be restarted", name=message.sensor)
        for one in named:
            yield send(one, messages.Restart())
        yield send(peer, messages.SensorRestarting(
            request=message.request, sensor=message.sensor))

    def _end_writes(self, now: float) -> Iterator[Output]:
        """Wait for what is being written: no file of what is removed next appears afterwards."""
        if not self._writer.wait(timeout_s=0.0 if self._presses.disk_hangs else _WRITES_S):
            raise errors.StoreError("the disk does not answer, nothing was removed")
        yield from self._written(now, self._writer.take_results())
        yield from self._presses.refuse_failed()

    def _requeue_damaged(self, error: errors.DamagedFaceError, kept_before: bool) -> None:
        self._jobs.requeue_damaged(error.capture_id, str(error), reset_attempts=kept_before)

    def _sensor_ready(
        self, now: float, peer: bytes, message: messages.SensorReady | messages.SensorState,
        key: str,
    ) -> Iterator[Output]:
        """Take a sensor, or tell it that there are too many; note what it says of itself."""
        if refused := self._refused(peer, message.name, key, self._peers.sensors, "sensors"):
            yield refused
        elif isinstance(message, messages.SensorReady):
            if self._peers.sensor_ready(peer, message.name, now, key):
                self._status.note_change()
                self._log.info("sensor ready", name=message.name, source=message.source,
                               key=key or LOCAL)
        elif self._peers.sensor_state(peer, message, now, key):
            self._status.note_change()
            self._log.info("sensor state", name=message.name, state=message.state,
                           reason=message.reason, identity=message.identity, key=key or LOCAL)

    def _worker_ready(
        self, now: float, peer: bytes, message: messages.WorkerReady, key: str
    ) -> Iterator[Output]:
        """Take a worker, or tell it that there are too many."""
        name, credit = message.name, message.credit
        if refused := self._refused(peer, name, key, self._peers.workers, "workers"):
            yield refused
            return
        known, asked = self._peers.workers.get(peer), self._peers.was_asked(peer)
        if known is None or known.away:
            self._status.note_change()
            self._log.info("worker ready", name=name, key=key or LOCAL)
        elif credit <= known.credit and not asked:
            self._rejections.note(
                "replayed", key=key or LOCAL, name=name, detail=f"credit {credit}")
        self._peers.worker_ready(peer, name, credit, now, key)

    def _refused(
        self, peer: bytes, name: str, key: str, known: Mapping[bytes, SensorPeer | WorkerPeer],
        kind: str,
    ) -> Output | None:
        """Give the message to a peer for which there is no room."""
        limit = self._peers.too_many(peer, key, known)
        if limit is None:
            return None
        why = f"{limit} {kind} are there already"
        self._rejections.note("limit", key=key or LOCAL, name=name, detail=why)
        return send(peer, messages.Denied(message=why))

    def _disconnected(self, peer: bytes, reason: str) -> Iterator[Output]:
        say = self._log.info if reason == "goodbye" else self._log.warning
        if sensor := self._peers.sensors.pop(peer, None):
            say("sensor gone", name=sensor.name, reason=reason, key=sensor.key or LOCAL)
            self._status.note_change()
            yield from self._presses.sensor_gone(peer, reason)
        if worker := self._peers.workers.pop(peer, None):
            say("worker gone", name=worker.name, reason=reason, key=worker.key or LOCAL)
            self._status.note_change()
            self._jobs.worker_lost(worker)
        self._peers.starting.pop(peer, None)
