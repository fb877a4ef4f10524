"""Who is connected to the hub: sensors and workers, and whether they still live."""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal

__all__ = ["MAX_PEERS", "Peers", "SensorPeer", "WorkerPeer"]

MAX_PEERS = 256
"""Of sensors, and of workers: whoever comes later is not taken, so that all fit into a status."""


@dataclass
class SensorPeer:
    """A capture process with its source open."""

    peer: bytes
    name: str
    seen: float
    """When it was last heard, seconds."""


@dataclass
class WorkerPeer:
    """A reconstruction process."""

    peer: bytes
    name: str
    seen: float
    """When it was last known to be alive and, where it has jobs, to hold one; seconds."""
    credit: int = -1
    """The last `WorkerReady.credit` heard."""
    free: bool = False
    """It has room for one more job."""
    jobs: list[str] = field(default_factory=list)
    """The captures that it was given and has not answered, in order: it works on the first."""
    alone: bool = False
    """The job that it was given last shall have none beside it."""


@dataclass
class Peers:
    """Peers by their connection."""

    sensors: dict[bytes, SensorPeer] = field(default_factory=dict)
    workers: dict[bytes, WorkerPeer] = field(default_factory=dict)

    def has_room(self, kind: Literal["sensor", "worker"], peer: bytes) -> bool:
        """Say whether a peer is known as such, or can be."""
        known: Collection[bytes] = self.sensors if kind == "sensor" else self.workers
        return peer in known or len(known) < MAX_PEERS

    def sensor_ready(self, peer: bytes, name: str, now: float) -> bool:
        """Note a sensor; True where it is new."""
        new = peer not in self.sensors
        self.sensors[peer] = SensorPeer(peer, name, now)
        return new

    def worker_ready(self, peer: bytes, name: str, credit: int, now: float) -> WorkerPeer:
        """Note that a worker is free, unless its credit was spent before."""
        worker = self.workers.setdefault(peer, WorkerPeer(peer, name, now))
        if credit > worker.credit:
            worker.credit, worker.free, worker.seen = credit, True, now
        return worker

    def heartbeat(self, peer: bytes, holding: str | None, now: float) -> bool:
        """Note a sign of life; False where the hub cannot do with it what it might.

        That is so where nobody of this id is known, and where a worker has nothing to do and its
        `WorkerReady` never came.
        """
        if sensor := self.sensors.get(peer):
            sensor.seen = now
        elif worker := self.workers.get(peer):
            # A worker that lives without the job it was given never got it: let it go silent.
            if not worker.jobs or holding is not None:
                worker.seen = now
            return worker.free or bool(worker.jobs) or holding is not None
        else:
            return False
        return True

    def postpone_timeouts(self, seconds: float) -> None:
        """Hold no silence against anyone that the hub could not have heard."""
        for one in self._all():
            one.seen += seconds

    def free_worker(self, *, alone: bool) -> WorkerPeer | None:
        """Give the free worker with the fewest jobs, none where it is to be `alone` with one."""
        free = [worker for worker in self.workers.values() if worker.free and (
            not worker.jobs or not (alone or worker.alone))]
        return min(free, key=lambda worker: len(worker.jobs), default=None)

    def sensor(self) -> SensorPeer | None:
        """Give the sensor that has been known longest."""
        return next(iter(self.sensors.values()), None)

    def silent(self, before: float) -> list[bytes]:
        """Give the peers that were last heard before a time."""
        return [one.peer for one in self._all() if one.seen < before]

    def _all(self) -> list[SensorPeer | WorkerPeer]:
        return [*self.sensors.values(), *self.workers.values()]
