"""A worker's process: one job at a time, from frame to face, and the next one at hand."""

import os
import socket
import time
from collections.abc import Callable

import cv2
import structlog

from recon import ReconstructionError, reconstruct, warm
from recon.face import Face
from service.background import Background
from service.failpoints import failpoint
from service.link import HubLink
from service.messages import Announce, Heartbeat, Job, JobFailed, Result, WorkerReady
from service.payload import Arrays, FaceHeader
from service.settings import ServiceSettings
from service.stopping import StopSignal
from service.wire import Packet

__all__ = ["run"]


_FINISH_S = 3.0
"""Time for the job under way once told to stop, seconds; the supervisor kills after 5."""


def run(settings: ServiceSettings) -> int:
    """Work until SIGINT or SIGTERM and give the exit status.

    The job under way is finished, or handed back to the hub where that takes too long.
    """
    cv2.setNumThreads(1)  # one worker for each core; more threads would only fight
    with StopSignal() as stop:
        begun = time.monotonic()
        warm()
        structlog.get_logger("worker").info("warm", seconds=round(time.monotonic() - begun, 2))
        with Background[Face]("recon") as compute:
            with HubLink(settings, "worker") as link:
                worker = _Worker(settings, link, compute)
                worker.serve(stop)
                worker.finish()
            if compute:
                os._exit(stop.exit_status)  # handed back, but its thread would go on to the end
        return stop.exit_status


class _Worker:
    def __init__(
        self, settings: ServiceSettings, link: HubLink, compute: Background[Face]
    ) -> None:
        self._settings = settings
        self._link = link
        self._compute = compute
        self._log = structlog.get_logger("worker")
        self._job: Job | None = None
        self._next: Packet | None = None
        """The job that follows."""
        self._answer: Callable[[], bool] | None = None
        self._credit = 0

    def serve(self, stop: StopSignal) -> None:
        for packet in self._link.packets(stop, self._compute, self._holding):
            if packet is not None:
                self._receive(packet)
            self._deliver()
            if self._compute.ended():
                if self._answer is None:
                    self._answer = self._computed()
                    self._deliver()
            elif self._compute.elapsed_s > self._settings.job_timeout_s:
                self._log.error("job takes too long", capture_id=self._holding(),
                                seconds=self._compute.elapsed_s)
                os._exit(1)

    def _deliver(self) -> None:
        if self._answer and self._answer():  # kept until the hub is there to take it
            failpoint("worker.result.sent")
            self._answer = None

    def finish(self) -> None:
        """End the job under way and deliver it; where that takes too long, leave it."""
        self._next = None
        deadline = time.monotonic() + _FINISH_S
        while not self._compute.ends_within(min(self._settings.heartbeat_s, _FINISH_S)):
            if time.monotonic() >= deadline:
                self._log.warning("job handed back", capture_id=self._holding(),
                                  seconds=round(self._compute.elapsed_s, 1))
                return
            self._link.send(Heartbeat(holding=self._holding()))
        self._deliver()
        if self._compute:
            self._answer = self._computed()
            self._deliver()

    def _holding(self) -> str | None:
        return self._job.capture_id if self._job else None

    def _ready(self) -> None:
        self._link.send(WorkerReady(
            name=f"{socket.gethostname()}/{os.getpid()}", credit=self._credit))

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case Announce():
                if self._next is None:
                    self._ready()
            case Job() as job:
                if self._next is not None:  # the hub redelivers what this worker does not hold
                    self._log.warning("job dropped, busy", capture_id=job.capture_id)
                    return
                failpoint("worker.job.received")
                self._next = packet
                if self._job is None:
                    self._begin()

    def _begin(self) -> None:
        """Work on the next job, if there is one, and ask for the one after it."""
        packet, self._next, self._job = self._next, None, None
        if packet and isinstance(packet.message, Job):
            self._job = job = packet.message
            self._log.info("job", capture_id=job.capture_id, attempt=job.attempt)
            self._compute.start(lambda: _face_of(job, packet.arrays))
            self._credit += 1
            self._ready()

    def _computed(self) -> Callable[[], bool]:
        """Begin the next job and give what sends the answer to the one before."""
        job = self._job
        if job is None:
            raise RuntimeError("a computation without a job ended")
        try:
            face = self._taken()
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


    def _taken(self) -> Face:
        try:
            return self._compute.take()
        finally:
            self._begin()


def _face_of(job: Job, arrays: Arrays) -> Face:
    failpoint("worker.job.computing")
    return reconstruct(job.frame.join(arrays), job.settings)
