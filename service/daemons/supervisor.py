"""The processes of the service: which there are, how they are started, watched and stopped."""

import math
import select
import signal
import subprocess
import time
from collections.abc import Sequence

import structlog

from denseface.service.daemons._watched_process import (
    AttendedClock,
    End,
    ProcessSpec,
    WatchedProcess,
)
from denseface.service.daemons.startup import ONE_THREAD
from denseface.service.errors import AddressError
from denseface.service.runtime.folder_lock import check_folder
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.watching.service_manager import ServiceManager
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_bindable, is_local

__all__ = ["ProcessSpec", "Supervisor", "check_settings", "process_table"]

_GRACE_S = 5.0
"""From SIGTERM to SIGKILL, seconds."""
_USAGE = 2
"""Exit status of wrong usage or input: another try would end the same."""
_LOOKS = 8
"""Looks at a silent process before it counts as hung."""
_LOOK_MAX_S = 1.0
"""Longest time between two looks, seconds."""


def process_table(workers: int, common: Sequence[str], hub: Sequence[str],
                  captures: Sequence[Sequence[str]],
                  kiosk: Sequence[str] | None = None) -> list[ProcessSpec]:
    """Give all processes of the service, in the order of starting; the hub is stopped last.

    `common`, `hub`, `captures` and `kiosk` are the flags of all, of the hub, of each capture
    process and of the page for visitors, which there is none of where that is None.
    """
    return [
        ProcessSpec("hub", ("hub", *hub, *common)),
        # A sensor may be unplugged for an hour: the hub goes on meanwhile.
        *(ProcessSpec(f"capture-{number}" if len(captures) > 1 else "capture",
                      ("capture", *flags, *common), vital=False)
          for number, flags in enumerate(captures, 1)),
        *(ProcessSpec(f"worker-{number}", ("worker", *common), ONE_THREAD)
          for number in range(1, workers + 1)),
        # Presses go on without it, also where its certificate is too old one day.
        *([ProcessSpec("kiosk", ("kiosk", *kiosk, *common), vital=False, needed=False)]
          if kiosk is not None else []),
    ]


def check_settings(settings: ServiceSettings) -> None:
    """Raise at once what the hub would raise later, among other lines of the log.

    Raises
    ------
    AddressError, KeyFileError, HubRunningError, StoreError
        Where an address or the data folder cannot be had.
    """
    if not is_local(settings.address):
        raise AddressError(
            f"{settings.address}: the processes of `denseface up` meet at a local address; "
            f"--listen {settings.address} lets other machines in, with CURVE keys")
    check_bindable(settings.address)
    check_folder(settings.data)
    if settings.listen:
        # With all that listens, which the supervisor has no other use for.
        from denseface.service.transport.listeners import server_credentials

        server_credentials(settings)


class Supervisor:
    """Runs a process table until it is told to stop.

    Parameters
    ----------
    table : the hub first
    hang_timeout_s : silence after which a process is ended, seconds
    manager : is told that the hub is ready, and at each look that the supervisor lives
    """

    def __init__(self, table: Sequence[ProcessSpec], hang_timeout_s: float = 30.0,
                 manager: ServiceManager | None = None) -> None:
        self._processes = [WatchedProcess(spec) for spec in table]
        self._hang_timeout_s = hang_timeout_s
        self._manager = manager or ServiceManager({})
        limits_s = hang_timeout_s, self._manager.limit_s or hang_timeout_s
        self._look_s = min(min(limits_s) / _LOOKS, _LOOK_MAX_S)
        self._clock = AttendedClock(self._look_s)
        self._told = False
        """Whether the hub that runs knows the counts of restarts."""
        self._log = structlog.get_logger("supervisor")

    def run(self) -> int:
        """Start all, restart what ends or hangs, stop all at SIGINT or SIGTERM.

        Gives the exit status. All stop with status 2 where one that is needed ends so: its usage
        or input is wrong. All stop with status 1 where a vital one ends again and again.
        """
        with StopSignal(signal.SIGCHLD) as stop:
            try:
                return self._watch(stop)
            finally:
                self._manager.stopping()
                self._stop_all()

    def _watch(self, stop: StopSignal) -> int:
        while True:
            if status := self._start_due():
                return status
            self._tell_hub()
            waiting = [process.due for process in self._processes if process.running is None]
            next_start = min(waiting, default=math.inf) - time.monotonic()
            select.select([stop], [], [], max(0.0, min(self._look_s, next_start)))
            stop.drain()
            if stop:
                return stop.exit_status
            for process in self._processes:
                end = process.ended()
                if end and (status := self._ended(process, end)):
                    return status
            self._kill_hung()
            self._tell_manager()

    def _start_due(self) -> int:
        """Start what is to be started; give the status with which all stop, or 0."""
        now, attended = time.monotonic(), self._clock.look()
        for process in self._processes:
            if process.running is None and now >= process.due:
                try:
                    process.start(attended)
                except OSError as error:  # no memory, no descriptor: it may be there again soon
                    self._log.error("cannot be started", name=process.spec.name, reason=str(error))
                    if not process.plan_restart(now) and process.spec.vital:
                        return 1
                if process is self._processes[0]:
                    self._told = False
        return 0

    def _tell_hub(self) -> None:
        if not self._told:
            self._told = self._processes[0].send_restarts({
                process.spec.name: {**process.counts, "last": process.last_end}
                for process in self._processes if process.counts})

    def _tell_manager(self) -> None:
        self._manager.alive()
        if self._processes[0].started:
            self._manager.ready("watches hub, sensors and workers")

    def _kill_hung(self) -> None:
        attended = self._clock.look()
        for process in self._processes:
            if silence := process.kill_if_hung(attended, self._hang_timeout_s):
                self._log.error("hangs, killed", name=process.spec.name,
                                silent_s=round(silence, 1))

    def _ended(self, process: WatchedProcess, end: End) -> int:
        """Plan the restart of a process that ended; give the status with which all stop, or 0."""
        name = process.spec.name
        if end.status == _USAGE and process.spec.needed:
            return _USAGE  # it has said why
        self._told = False
        calm = process.plan_restart(time.monotonic(), holding=end.holding)
        if process.spec.vital and not calm:
            self._log.error("ends again and again", name=name, status=end.status)
            return 1
        self._log.warning("ended, will be started again", name=name, status=end.status,
                          reason=end.reason, held_a_job=end.holding,
                          in_s=round(max(0.0, process.due - time.monotonic()), 1))
        return 0

    def _stop_all(self) -> None:
        """Stop the hub last, so that the others can still send to it."""
        hub, *others = self._processes
        for group in (others, [hub]):
            running = [process.running for process in group if process.running]
            for one in running:
                one.terminate()
            deadline = time.monotonic() + _GRACE_S
            for one in running:
                try:
                    one.wait(max(0.0, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    self._log.warning("killed", pid=one.pid, after_s=_GRACE_S)
                    one.kill()
                    one.wait()
        for process in self._processes:
            process.close()
