"""A worker's process: one job at a time, from frame to face, and the next one at hand."""

import os
import socket
import time
from collections import deque
from collections.abc import Callable

import cv2
import structlog

from denseface import recon
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import Face
from denseface.service.protocol.messages import (
    Announce,
    Heartbeat,
    Job,
    JobFailed,
    Result,
    WorkerReady,
)
from denseface.service.protocol.packing import warm_packing
from denseface.service.protocol.payload import Arrays, FaceHeader
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_connectable
from denseface.service.transport.connection import Credentials
from denseface.service.transport.hub_connection import HubConnection

__all__ = ["run", "warm"]

_MOST_JOBS = 2
_FINISH_S = 3.0
"""Time for the job under way once told to stop, seconds; the supervisor kills after 5."""


def run(settings: ServiceSettings) -> int:
    """Work until SIGINT or SIGTERM and give the exit status.

    The job under way is finished, or handed back to the hub where that takes too long.

    Raises
    ------
    SettingsError
        Where the address or a key cannot be used.
    """
    check_connectable(settings.address)  # what is wrong with these is said before it is warm
    Credentials.of(settings)
    cv2.setNumThreads(1)  # one worker for each core; more threads would only fight
    with StopSignal() as stop:
        begun = time.monotonic()
        warm()
        structlog.get_logger("worker").info("warm", seconds=round(time.monotonic() - begun, 2))
        with Background[Face]("recon") as compute:
            with HubConnection(settings, "worker") as link:
                worker = _Worker(settings, link, compute)
                worker.serve(stop)
                worker.finish()
            if compute:
                os._exit(stop.exit_status)  # handed back, but its thread would go on to the end
        return stop.exit_status


def warm() -> None:
    """Compile and load what the first frame and its face would otherwise wait for."""
    recon.warm()
    warm_packing()


class _Worker:
    def __init__(
        self, settings: ServiceSettings, link: HubConnection, compute: Background[Face]
    ) -> None:
        self._settings = settings
        self._link = link
        self._compute = compute
        self._log = structlog.get_logger("worker")
        self._jobs: deque[Job] = deque()
        """The one under way, and the one that follows."""
        self._answer: Callable[[], bool] | None = None
        self._credit = 0

    def serve(self, stop: StopSignal) -> None:
        for packet in self._link.packets(stop, self._compute, self._holding):
            if packet is not None:
                self._receive(packet)
            self._deliver()
            while self._answer is None and self._compute.done():
                self._answer = self._computed()
                self._deliver()
            if not self._compute.done() and (
                    self._compute.elapsed_s > self._settings.job_timeout_s):
                self._log.error("job takes too long", capture_id=self._holding(),
                                seconds=self._compute.elapsed_s)
                os._exit(1)

    def _deliver(self) -> None:
        if self._answer and self._answer():  # kept until the hub is there to take it
            failpoint("worker.result.sent")
            self._answer = None

    def finish(self) -> None:
        """End the job under way and deliver it; where that takes too long, leave it."""
        self._deliver()
        if self._compute.cancel_queued():
            self._jobs.pop()
        deadline = time.monotonic() + _FINISH_S
        while self._compute:
            while not self._compute.wait(min(self._settings.heartbeat_s, _FINISH_S)):
                if time.monotonic() >= deadline:
                    self._log.warning("job handed back", capture_id=self._holding(),
                                      seconds=round(self._compute.elapsed_s, 1))
                    return
                self._link.send(Heartbeat(holding=self._holding()))
            self._answer = self._computed()
            self._deliver()

    def _holding(self) -> str | None:
        return self._jobs[0].capture_id if self._jobs else None

    def _ready(self) -> None:
        self._link.send(WorkerReady(
            name=f"{socket.gethostname()}/{os.getpid()}", credit=self._credit))

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if len(self._jobs) < _MOST_JOBS:
                    self._ready()
            case Job() as job:
                if len(self._jobs) == _MOST_JOBS:  # the hub redelivers what is not held here
                    self._log.warning("job dropped, busy", capture_id=job.capture_id)
                    return
                failpoint("worker.job.received")
                self._jobs.append(job)
                self._compute.start(lambda: _face_of(job, packet.arrays))
                if len(self._jobs) == 1:
                    self._begun()

    def _begun(self) -> None:
        """Ask for the job that follows the one under way, if there is one."""
        if self._jobs:
            self._credit += 1
            self._ready()
            job = self._jobs[0]
            self._log.info("job", capture_id=job.capture_id, attempt=job.attempt)

    def _computed(self) -> Callable[[], bool]:
        """Give what sends the answer to the job that ended; the next one is under way already."""
        job = self._jobs.popleft()
        self._begun()
        try:
            face = self._compute.result()
            failpoint("worker.job.computed")
            report = face.report.model_copy(update={"capture_id": job.capture_id})
            header, arrays = FaceHeader.of(Face(face.initial, face.dense, report))
            result = Result(
                capture_id=job.capture_id, settings_hash=job.settings_hash,
                frame_sha256=job.frame_sha256, face=header)
        except Exception as error:
            final = isinstance(error, ReconstructionError)
            say = self._log.warning if final else self._log.exception
            say("no face", capture_id=job.capture_id, error=type(error).__name__,
                reason=str(error))
            failure = JobFailed(
                capture_id=job.capture_id, settings_hash=job.settings_hash,
                frame_sha256=job.frame_sha256, error=type(error).__name__,
                message=str(error)[:4000], final=final)
            return lambda: self._link.send(failure)
        self._log.info("face", capture_id=job.capture_id, points=report.dense_points,
                       total_ms=round(report.timings_ms.get("total", 0.0)))
        return lambda: self._link.send(result, arrays)


def _face_of(job: Job, arrays: Arrays) -> Face:
    failpoint("worker.job.computing")
    return reconstruct(job.frame.join(arrays), job.settings)
