"""Starts the processes of the service, watches them, stops them.

The table of `processes` is all that runs.
"""

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

from denseface.service.runtime.signals import PARENT_VARIABLE, StopSignal

__all__ = ["ONE_THREAD", "ProcessSpec", "Supervisor", "processes"]

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: there is one for each core."""

_GRACE_S = 5.0
"""From SIGTERM to SIGKILL."""
_BACKOFF_S, _BACKOFF_MAX_S = 0.5, 30.0
_STORM_RESTARTS, _STORM_S = 5, 60.0
"""More restarts than this in this time: something is wrong that a restart does not mend."""
_USAGE = 2
"""Exit status that says that another try would end the same."""


@dataclass(frozen=True)
class ProcessSpec:
    """One row of the process table."""

    name: str
    arguments: tuple[str, ...]
    """Of the command `denseface`."""
    environment: dict[str, str] = field(default_factory=dict)
    vital: bool = True
    """All stop where this one ends again and again; else it is tried for ever."""


def processes(source: str, workers: int, common: Sequence[str], hub: Sequence[str],
              capture: Sequence[str]) -> list[ProcessSpec]:
    """Give the process table, in the order of starting; stopped in the other one.

    Parameters
    ----------
    common, hub, capture : further arguments of all, of the hub, of the capture process
    """
    return [
        ProcessSpec("hub", ("hub", *hub, *common)),
        # A sensor may be unplugged for an hour: the hub goes on meanwhile.
        ProcessSpec("capture", ("capture", *capture, *common, "--source", source), vital=False),
        *(ProcessSpec(f"worker-{number}", ("worker", *common), ONE_THREAD)
          for number in range(1, workers + 1)),
    ]


class _Process:
    """A row of the table and what runs of it."""

    def __init__(self, spec: ProcessSpec) -> None:
        self.spec = spec
        self.running: subprocess.Popen[bytes] | None = None
        self.due = 0.0
        self._restarts: deque[float] = deque()

    def start(self) -> None:
        environment = os.environ | self.spec.environment | {PARENT_VARIABLE: str(os.getpid())}
        # -P: a folder `service` where the user stands is not ours. In a group of its own: Ctrl-C
        # reaches the supervisor alone, which stops all in order.
        self.running = subprocess.Popen(
            [sys.executable, "-P", "-m", "denseface", *self.spec.arguments],
            env=environment, stdin=subprocess.DEVNULL, process_group=0)

    def ended(self) -> int | None:
        """Give the exit status of what ran, once."""
        status = self.running.poll() if self.running else None
        if status is not None:
            self.running = None
        return status

    def plan_restart(self, now: float) -> bool:
        """Set when to start again; False in a storm."""
        self._restarts.append(now)
        while self._restarts[0] < now - _STORM_S:
            self._restarts.popleft()
        self.due = now + min(_BACKOFF_S * 2 ** (len(self._restarts) - 1), _BACKOFF_MAX_S)
        return len(self._restarts) <= _STORM_RESTARTS


class Supervisor:
    """Runs a process table until it is told to stop."""

    def __init__(self, table: Sequence[ProcessSpec]) -> None:
        self._processes = [_Process(spec) for spec in table]
        self._log = structlog.get_logger("supervisor")

    def run(self) -> int:
        """Start all, keep all running, stop all at SIGINT or SIGTERM; give the exit status.

        A process that ends with status 2 was asked for the impossible: all stop, with that status.
        A vital one that ends again and again stops all too, with status 1.
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
        """Stop the hub last, so that the others can take their leave."""
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
