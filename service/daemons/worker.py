"""The worker process: frames to faces, one job at a time, the next one waiting here already."""

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

_MAX_JOBS = 2
"""The job under way and the one that follows it."""
_FINISH_S = 3.0
"""Time to finish the job under way when the process stops, seconds; below the supervisor's 5."""


def run(settings: ServiceSettings) -> int:
    """Work until SIGINT or SIGTERM and give the exit status.

    The job under way is finished, or handed back to the hub where that takes too long.

    Raises
    ------
    SettingsError
        Where the address or a key cannot be used.
    """
    check_connectable(settings.address)  # errors of the settings come before seconds of warm-up
    Credentials.of(settings)
    cv2.setNumThreads(1)
    with StopSignal() as stop:
        begun = time.monotonic()
        warm()
        structlog.get_logger("worker").info("warm", seconds=round(time.monotonic() - begun, 2))
        with Background[Face]("recon") as compute:
            with HubConnection(settings, "worker") as connection:
                worker = _Worker(settings, connection, compute)
                worker.serve(stop)
                worker.finish()
            if compute:
                os._exit(stop.exit_status)  # the job is handed back, its thread cannot be stopped
        return stop.exit_status


def warm() -> None:
    """Compile and load all that the first job would otherwise wait for."""
    recon.warm()
    warm_packing()


class _Worker:
    def __init__(
        self, settings: ServiceSettings, connection: HubConnection, compute: Background[Face]
    ) -> None:
        self._settings = settings
        self._connection = connection
        self._compute = compute
        self._log = structlog.get_logger("worker")
        self._jobs: deque[Job] = deque()
        """The one under way, then the one that follows."""
        self._send_answer: Callable[[], bool] | None = None
        """Sends the answer to a job that ended; False where the hub is not there."""
        self._credit = 0
        """Jobs asked for so far."""

    def serve(self, stop: StopSignal) -> None:
        for packet in self._connection.packets(stop, self._compute, self._holding):
            if packet is not None:
                self._receive(packet)
            self._deliver()
            while self._send_answer is None and self._compute.done():
                self._send_answer = self._answer_job()
                self._deliver()
            if not self._compute.done() and (
                    self._compute.elapsed_s > self._settings.job_timeout_s):
                self._log.error("job takes too long", capture_id=self._holding(),
                                seconds=self._compute.elapsed_s)
                os._exit(1)

    def _deliver(self) -> None:
        if self._send_answer and self._send_answer():  # else it is tried again
            failpoint("worker.result.sent")
            self._send_answer = None

    def finish(self) -> None:
        """Finish the job under way and deliver its answer; leave it where that takes too long."""
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
                self._connection.send(Heartbeat(holding=self._holding()))
            self._send_answer = self._answer_job()
            self._deliver()

    def _holding(self) -> str | None:
        return self._jobs[0].capture_id if self._jobs else None

    def _send_ready(self) -> None:
        self._connection.send(WorkerReady(
            name=f"{socket.gethostname()}/{os.getpid()}", credit=self._credit))

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if len(self._jobs) < _MAX_JOBS:
                    self._send_ready()
            case Job() as job:
                if len(self._jobs) == _MAX_JOBS:  # the hub redelivers what no heartbeat names
                    self._log.warning("job dropped, busy", capture_id=job.capture_id)
                    return
                failpoint("worker.job.received")
                self._jobs.append(job)
                self._compute.start(lambda: _reconstruct(job, packet.arrays))
                if len(self._jobs) == 1:
                    self._ask_for_next()

    def _ask_for_next(self) -> None:
        """Ask for the job that follows the one under way, if there is one."""
        if self._jobs:
            self._credit += 1
            self._send_ready()
            job = self._jobs[0]
            self._log.info("job", capture_id=job.capture_id, attempt=job.attempt)

    def _answer_job(self) -> Callable[[], bool]:
        """Give what sends the answer to the job that ended; the next one has begun already."""
        job = self._jobs.popleft()
        self._ask_for_next()
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
            return lambda: self._connection.send(failure)
        self._log.info("face", capture_id=job.capture_id, points=report.dense_points,
                       total_ms=round(report.timings_ms.get("total", 0.0)))
        return lambda: self._connection.send(result, arrays)


def _reconstruct(job: Job, arrays: Arrays) -> Face:
    failpoint("worker.job.computing")
    return reconstruct(job.frame.join(arrays), job.settings)
