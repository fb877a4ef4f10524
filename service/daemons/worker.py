"""The worker process: frames to faces, one job at a time, the next one waiting here already."""

import os
import socket
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import structlog

from denseface import recon
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import Face
from denseface.recon.numerics.compilation.progress import compiling
from denseface.recon.pipeline import ends_the_same
from denseface.service.log.output import exit_now
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import MAX_JOBS
from denseface.service.protocol.packing import warm_packing
from denseface.service.protocol.payload import Arrays, FaceHeader
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background
from denseface.service.runtime.collection import collect_from_now_on
from denseface.service.runtime.failpoints import failpoint
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.watching.supervisor_link import Beat, SupervisorLink
from denseface.service.settings import ServiceSettings, check_frame_size
from denseface.service.transport.addresses import check_connectable
from denseface.service.transport.connection import Credentials
from denseface.service.transport.hub_connection import HubConnection

__all__ = ["run", "warm"]

_FINISH_S = 3.0
"""Time to finish the job under way when the process stops, seconds; below the supervisor's 5."""
_KERNEL_S = 300.0
"""Longest time from one compiled kernel to the next, seconds."""
_log = structlog.get_logger("worker")


def run(settings: ServiceSettings, supervisor: SupervisorLink | None = None) -> int:
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
    supervisor = supervisor or SupervisorLink()
    with StopSignal() as stop:
        with Background[None]("warm") as warming, Background[Face]("recon") as compute:
            with HubConnection(settings, "worker", supervisor) as connection:
                worker = _Worker(settings, connection, compute, supervisor)
                if worker.start(stop, warming):
                    worker.serve(stop)
                    worker.finish()
            if compute or warming:
                exit_now(stop.exit_status)  # a job is handed back, its thread cannot be stopped
        return stop.exit_status


def warm() -> None:
    """Compile and load all that the first job would otherwise wait for."""
    with compiling.session():
        warm_packing()
        recon.warm()


@dataclass
class _Worker:
    settings: ServiceSettings
    connection: HubConnection
    compute: Background[Face]
    supervisor: SupervisorLink = field(default_factory=SupervisorLink)
    jobs: deque[messages.Job] = field(default_factory=deque)
    """The one under way, then the one that follows."""
    send_answer: Callable[[], bool] | None = None
    """Sends the answer to a job that ended; False where the hub is not there."""
    credit: int = 0
    """Jobs asked for so far."""
    name: str = field(default_factory=lambda: f"{socket.gethostname()}/{os.getpid()}")

    def start(self, stop: StopSignal, warming: Background[None]) -> bool:
        """Get ready while the hub hears how far that is; False where that was stopped."""
        begun = time.monotonic()
        warming.start(warm)
        for _ in self.connection.packets(stop, warming, self._progress):
            if warming.done():
                warming.result()
                collect_from_now_on()
                _log.info("warm", seconds=round(time.monotonic() - begun, 2))
                self._send_ready()
                self.supervisor.manager.ready()
                return True
            self._say_how_far()
        return False

    def serve(self, stop: StopSignal) -> None:
        for packet in self.connection.packets(stop, self.compute, self._heartbeat):
            if packet is not None:
                self._receive(packet)
            self._deliver()
            while self.send_answer is None and self.compute.done():
                self.send_answer = self._answer_job()
                self._deliver()
            if not self.compute.done() and (
                    self.compute.elapsed_s > self.settings.job_timeout_s):
                _log.error("job takes too long", capture_id=self._holding(),
                           seconds=self.compute.elapsed_s)
                exit_now(1)

    def _deliver(self) -> None:
        if self.send_answer and self.send_answer():  # else it is tried again
            failpoint("worker.result.sent")
            self.send_answer = None
            self.supervisor.beat(Beat.HOLDING if self.jobs else Beat.IDLE)

    def finish(self) -> None:
        """Finish the job under way and deliver its answer; leave it where that takes too long."""
        self._deliver()
        if self.compute.cancel_queued():
            self.jobs.pop()
        deadline = time.monotonic() + _FINISH_S
        while self.compute:
            while not self.compute.wait(min(self.settings.heartbeat_s, _FINISH_S)):
                if time.monotonic() >= deadline:
                    _log.warning("job handed back", capture_id=self._holding(),
                                 seconds=round(self.compute.elapsed_s, 1))
                    return
                self.connection.send(self._heartbeat())
            self.send_answer = self._answer_job()
            self._deliver()

    def _holding(self) -> str | None:
        return self.jobs[0].capture_id if self.jobs else None

    def _heartbeat(self) -> messages.Heartbeat:
        return messages.Heartbeat(holding=self._holding())

    def _progress(self) -> messages.Heartbeat:
        """Say how far it is with its kernels, where these are not just loaded."""
        if (progress := compiling.progress) is None:
            return messages.Heartbeat()
        return messages.Heartbeat(compiling=messages.Compiling(
            name=self.name, done=progress.done, total=progress.total))

    def _say_how_far(self) -> None:
        """Tell the service manager what the start waits for; it is to end where that gets stuck."""
        if (progress := compiling.progress) is None:
            self.supervisor.manager.status("loads its kernels")
        else:
            how_far = f"compiles its kernels, {progress.done} of {progress.total}"
            self.supervisor.manager.step(how_far, _KERNEL_S)

    def _send_ready(self) -> None:
        sent = self.connection.send(messages.WorkerReady(name=self.name, credit=self.credit))
        self.supervisor.manager.status("takes frames" if sent else "waits for the hub")

    def _receive(self, packet: Packet) -> None:
        match packet.message:
            case messages.Announce():
                if len(self.jobs) < MAX_JOBS:
                    self._send_ready()
            case messages.Job() as job:
                if len(self.jobs) == MAX_JOBS:  # the hub redelivers what no heartbeat names
                    _log.warning("job dropped, busy", capture_id=job.capture_id)
                    return
                # Before anything of the job is touched: if that ends this process, the job is why.
                self.supervisor.beat(Beat.HOLDING)
                failpoint("worker.job.received")
                self.jobs.append(job)
                self.compute.start(
                    lambda: _reconstruct(job, packet.arrays, self.settings.max_frame_pixels))
                if len(self.jobs) == 1:
                    self._ask_for_next()

    def _ask_for_next(self) -> None:
        """Ask for the job that follows the one under way, if there is one."""
        if self.jobs:
            self.credit += 1
            self._send_ready()
            job = self.jobs[0]
            _log.info("job", capture_id=job.capture_id, attempt=job.attempt)

    def _answer_job(self) -> Callable[[], bool]:
        """Give what sends the answer to the job that ended; the next one has begun already."""
        job = self.jobs.popleft()
        self._ask_for_next()
        try:
            face = self.compute.result()
            failpoint("worker.job.computed")
            report = face.report.model_copy(update={"capture_id": job.capture_id})
            header, arrays = FaceHeader.of(Face(face.initial, face.dense, report))
            result = messages.Result(
                capture_id=job.capture_id, settings_hash=job.settings_hash,
                frame_sha256=job.frame_sha256, face=header)
        except Exception as error:
            final = ends_the_same(error)
            # One with a cause may be a fault of ours, though another attempt ends the same.
            named = isinstance(error, ReconstructionError) and error.__cause__ is None
            say = _log.warning if named else _log.exception
            say("no face", capture_id=job.capture_id, error=type(error).__name__,
                reason=str(error))
            failure = messages.JobFailed(
                capture_id=job.capture_id, settings_hash=job.settings_hash,
                frame_sha256=job.frame_sha256, error=type(error).__name__,
                message=str(error)[:4000], final=final)
            return lambda: self.connection.send(failure)
        _log.info("face", capture_id=job.capture_id, points=report.dense_points,
                  total_ms=round(report.timings_ms.get("total", 0.0)))
        return lambda: self.connection.send(result, arrays)


def _reconstruct(job: messages.Job, arrays: Arrays, max_pixels: int) -> Face:
    failpoint("worker.job.computing")
    check_frame_size(job.frame.calibration, max_pixels)
    return reconstruct(job.frame.join(arrays), job.settings)
