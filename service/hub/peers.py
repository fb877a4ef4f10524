"""The sensors and workers that are connected to the hub, and whether they are alive."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from denseface.service.hub import sensors
from denseface.service.hub.sensors import SensorPeer
from denseface.service.protocol.message_base import MAX_JOBS
from denseface.service.protocol.sensor_messages import SensorState
from denseface.service.protocol.status import Compiling
from denseface.service.runtime.bounded_dict import BoundedDict

MAX_PEERS = 256
"""Most sensors, and most workers: so many fit into a `Status`. Others are not taken."""
MAX_PEERS_PER_KEY = 64
"""Most sensors, and most workers, that connect with one key: one key is one machine."""
_MAX_ANNOUNCED = 2 * MAX_PEERS
"""Peers of which it is remembered that they were asked to say that they are ready."""


@dataclass
class WorkerPeer:
    """A reconstruction process."""

    peer: bytes
    name: str
    seen: float
    """When it last said something, and that it holds a job where it was sent one; seconds."""
    key: str = ""
    """As of a sensor."""
    credit: int = -1
    """The last `WorkerReady.credit` heard."""
    free: bool = False
    """Ready for one more job."""
    jobs: list[str] = field(default_factory=list)
    """Captures sent and not answered, in order: it works on the first."""
    deadline: float = math.inf
    """When the first is taken back, whatever it says; seconds."""
    away: bool = False
    """Its connection has ended: it may come back by another one."""
    alone: bool = False
    """No job is to be sent beside the last one."""


@dataclass
class StartingWorker:
    """A process that says that it compiles, and will be ready then."""

    peer: bytes
    seen: float
    """When it last said so, seconds."""
    key: str
    """As of a sensor."""
    compiling: Compiling


@dataclass
class Peers:
    """Peers by the routing id of their connection."""

    sensors: dict[bytes, SensorPeer] = field(default_factory=dict)
    workers: dict[bytes, WorkerPeer] = field(default_factory=dict)
    starting: dict[bytes, StartingWorker] = field(default_factory=dict)
    _asked: BoundedDict[bytes, int] = field(
        default_factory=lambda: BoundedDict(_MAX_ANNOUNCED))
    """How often a peer was asked to say that it is ready, less the times that it did."""

    def sensor_ready(self, peer: bytes, name: str, now: float, key: str = "") -> bool:
        """Add a sensor; True where it is new."""
        if known := self.sensors.get(peer):
            known.name, known.seen, known.key = name, now, key
            return False
        for one in self.sensors.values():
            # Its process may have died, and this be the next.
            one.doubted |= (one.name, one.key) == (name, key)
        self.sensors[peer] = SensorPeer(peer, name, now, key)
        return True

    def sensor_state(self, peer: bytes, message: SensorState, now: float, key: str = "") -> bool:
        """Note what a sensor says of itself, add it where it is new; True where it is another."""
        new = self.sensor_ready(peer, message.name, now, key)
        return self.sensors[peer].note(message, now) or new

    def worker_ready(self, peer: bytes, name: str, credit: int, now: float, key: str = "") -> None:
        """Mark a worker as free, unless this credit was used before."""
        self.starting.pop(peer, None)
        worker = self.workers.setdefault(peer, WorkerPeer(peer, name, now, key))
        if worker.away:  # by another connection that calls itself the same: its credit begins anew
            worker.away, worker.name, worker.credit = False, name, -1
        if credit > worker.credit:
            worker.credit, worker.free, worker.seen = credit, True, now

    def worker_compiles(
        self, peer: bytes, compiling: Compiling, now: float, key: str = ""
    ) -> None:
        """Note how far a worker is that is not ready yet, unless there are too many."""
        if peer not in self.workers and self.too_many(peer, key, self.starting) is None:
            self.starting[peer] = StartingWorker(peer, now, key, compiling)

    def ask_for_ready(self, peer: bytes) -> None:
        """Note that a peer was asked to say that it is ready.

        All heartbeats that the network held back come at once, and each is answered so.
        """
        self._asked[peer] = self._asked.get(peer, 0) + 1

    def was_asked(self, peer: bytes) -> bool:
        """Say whether a peer that says it is ready answers with that, once for each asking."""
        if not (times := self._asked.pop(peer, 0)):
            return False
        if times > 1:
            self._asked[peer] = times - 1
        return True

    def heartbeat(self, peer: bytes, holding: str | None, now: float) -> bool:
        """Note a heartbeat; False where the peer has to say that it is ready.

        That is so of an unknown peer, and of a worker without a job whose `WorkerReady` was lost.
        """
        self.starting.pop(peer, None)
        if sensor := self.sensors.get(peer):
            sensor.seen = now
        elif worker := self.workers.get(peer):
            # A worker that was sent a job and holds none did not get it: it counts as silent.
            if not worker.jobs or holding is not None:
                worker.seen = now
            return worker.free or bool(worker.jobs) or holding is not None
        else:
            return False
        return True

    def postpone_timeouts(self, seconds: float) -> None:
        """Allow every peer so much more silence."""
        for one in self._all():
            one.seen += seconds
        for worker in self.workers.values():
            worker.deadline += seconds

    def free_worker(self, *, alone: bool) -> WorkerPeer | None:
        """Return the free worker with the fewest jobs; one without any where the job is `alone`."""
        free = [worker for worker in self.workers.values()
                if worker.free and len(worker.jobs) < MAX_JOBS
                and (not worker.jobs or not (alone or worker.alone))]
        return min(free, key=lambda worker: len(worker.jobs), default=None)

    def sensor(self, name: str | None = None) -> SensorPeer | None:
        """Return the sensor to ask; see `choose`."""
        return sensors.choose(self.sensors.values(), name)

    def doubt(self, peer: bytes, *, doubted: bool = True) -> None:
        """Ask a sensor only where no other can be asked: it lives and gives no frames."""
        if sensor := self.sensors.get(peer):
            sensor.doubted = doubted

    def overdue(self, now: float) -> list[WorkerPeer]:
        """Return the workers whose first job should have been answered."""
        return [worker for worker in self.workers.values()
                if worker.jobs and now >= worker.deadline]

    def silent(self, before: float) -> list[bytes]:
        """Return the peers that said nothing since a time."""
        return [one.peer for one in self._all() if one.seen < before]

    @staticmethod
    def too_many(
        peer: bytes, key: str, known: Mapping[bytes, SensorPeer | StartingWorker | WorkerPeer]
    ) -> int | None:
        """Give the limit that a new sensor or worker would exceed; None where there is room."""
        if peer in known:
            return None
        if len(known) >= MAX_PEERS:
            return MAX_PEERS
        own = sum(one.key == key for one in known.values())
        return MAX_PEERS_PER_KEY if key and own >= MAX_PEERS_PER_KEY else None

    def _all(self) -> list[SensorPeer | StartingWorker | WorkerPeer]:
        return [*self.sensors.values(), *self.starting.values(), *self.workers.values()]
