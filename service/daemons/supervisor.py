"""The processes of the service: which there are, how they are started, watched and stopped."""

import os
import select
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import structlog

from denseface.service.daemons.startup import ONE_THREAD
from denseface.service.errors import AddressError
from denseface.service.runtime.signals import PARENT_VARIABLE, StopSignal
from denseface.service.settings import ServiceSettings
from denseface.service.storage import check_folder
from denseface.service.transport.addresses import check_bindable, is_local
from denseface.service.transport.listeners import server_credentials

__all__ = ["ProcessSpec", "Supervisor", "check_settings", "process_table"]

_GRACE_S = 5.0
"""From SIGTERM to SIGKILL, seconds."""
_BACKOFF_S = 0.5
"""Pause before the restart that follows a first end, seconds; doubled at each further one."""
_BACKOFF_MAX_S = 30.0
"""Longest pause before a restart, seconds."""
_STORM_S = 60.0
"""Time over which restarts are counted, seconds."""
_STORM_RESTARTS = 5
"""More restarts than this in `_STORM_S`: something is wrong that a restart does not mend."""
_USAGE = 2
"""Exit status of wrong usage or input: another try would end the same."""


@dataclass(frozen=True)
class ProcessSpec:
    """One row of the process table."""

    name: str
    arguments: tuple[str, ...]
    """Of the command `denseface`."""
    environment: dict[str, str] = field(default_factory=dict)
    """Added to the supervisor's own."""
    vital: bool = True
    """All stop where this one ends again and again; else it is tried for ever."""


def process_table(workers: int, common: Sequence[str], hub: Sequence[str],
                  capture: Sequence[str]) -> list[ProcessSpec]:
    """Give all processes of the service, in the order of starting; the hub is stopped last.

    `common`, `hub` and `capture` are the flags of all, of the hub and of the capture process.
    """
    return [
        ProcessSpec("hub", ("hub", *hub, *common)),
        # A sensor may be unplugged for an hour: the hub goes on meanwhile.
        ProcessSpec("capture", ("capture", *capture, *common), vital=False),
        *(ProcessSpec(f"worker-{number}", ("worker", *common), ONE_THREAD)
          for number in range(1, workers + 1)),
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
        server_credentials(settings)


@dataclass
class _Process:
    """A row of the table and the process that runs for it."""

    spec: ProcessSpec
    running: subprocess.Popen[bytes] | None = None
    due: float = 0.0
    """When to start, by the monotonic clock, seconds."""
    restarts: deque[float] = field(default_factory=deque)

    def start(self) -> None:
        environment = os.environ | self.spec.environment | {PARENT_VARIABLE: str(os.getpid())}
        # -P: a folder `denseface` in the working directory is not ours. A process group of its
        # own: Ctrl-C reaches the supervisor alone, which stops all in order.
        self.running = subprocess.Popen(
            [sys.executable, "-P", "-m", "denseface", *self.spec.arguments],
            env=environment, stdin=subprocess.DEVNULL, process_group=0)

    def ended(self) -> int | None:
        """Give the exit status of a process that ended, once."""
        status = self.running.poll() if self.running else None
        if status is not None:
            self.running = None
        return status

    def plan_restart(self, now: float) -> bool:
        """Set when to start again; False in a storm."""
        self.restarts.append(now)
        while self.restarts[0] < now - _STORM_S:
            self.restarts.popleft()
        self.due = now + min(_BACKOFF_S * 2 ** (len(self.restarts) - 1), _BACKOFF_MAX_S)
        return len(self.restarts) <= _STORM_RESTARTS


class Supervisor:
    """Runs a process table until it is told to stop."""

    def __init__(self, table: Sequence[ProcessSpec]) -> None:
        self._processes = [_Process(spec) for spec in table]
        self._log = structlog.get_logger("supervisor")

    def run(self) -> int:
        """Start all, restart what ends, stop all at SIGINT or SIGTERM; give the exit status.

        All stop with status 2 where one ends so: its usage or input is wrong.
        All stop with status 1 where a vital one ends again and again.
        """
        with StopSignal(signal.SIGCHLD) as stop:
            try:
                return self._watch(stop)
            finally:
                self._stop_all()

    def _watch(self, stop: StopSignal) -> int:
        while True:
            now = time.monotonic()
            for process in self._processes:
                if process.running is None and now >= process.due and not stop:
                    process.start()
            waiting = [process.due for process in self._processes if process.running is None]
            timeout = max(0.0, min(waiting) - now) if waiting else None
            select.select([stop], [], [], timeout)
            stop.drain()
            if stop:
                return stop.exit_status
            for process in self._processes:
                status = process.ended()
                if status is None:
                    continue
                name = process.spec.name
                if status == _USAGE:
                    return _USAGE  # it has said why
                calm = process.plan_restart(time.monotonic())
                if process.spec.vital and not calm:
                    self._log.error("ends again and again", name=name, status=status)
                    return 1
                self._log.warning("ended, will be started again", name=name, status=status,
                                  in_s=round(max(0.0, process.due - time.monotonic()), 1))

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
