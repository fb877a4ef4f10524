"""Hub, capture process and workers as real processes, restarted at once when they end."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from denseface.service.client import Client
from denseface.service.errors import ServiceError
from denseface.service.runtime.failpoints import (
    FAILPOINT_NAMES,
    FAILPOINTS_VARIABLE,
    TOKENS_VARIABLE,
)
from tests.chaos.log_pipe import LogPipe
from tests.chaos.thief import Thief
from tests.waiting import LIMIT_S, PATIENCE

__all__ = ["PACE", "Cluster", "Nursery", "Part", "until"]

_REPOSITORY = Path(__file__).resolve().parents[2]
_WATCH_S = 0.01

PACE = {"DENSEFACE_HEARTBEAT_S": "0.2", "DENSEFACE_RESEND_S": "0.3",
        "DENSEFACE_LIVENESS": f"{min(3 * PATIENCE, 100):.0f}",
        "DENSEFACE_TAKE_TIMEOUT_S": f"{3 * PATIENCE:g}",
        "DENSEFACE_JOB_TIMEOUT_S": f"{10 * PATIENCE:g}",
        "DENSEFACE_ATTEMPTS": "10", "DENSEFACE_RETENTION": "off"}
"""Settings of the service that let a fault show in tenths of seconds."""


def until(true: Callable[[], bool], what: str, within_s: float = LIMIT_S) -> None:
    """Look again and again until something is so."""
    deadline = time.monotonic() + within_s
    while not true():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{what}: did not come about within {within_s:g} s")
        time.sleep(_WATCH_S)


class Nursery:
    """Forks processes; see `tests.chaos.nursery`.

    Parameters
    ----------
    faults : library that makes file operations fail, see `Cluster.fail_disk`
    """

    def __init__(self, faults: Path | None = None) -> None:
        preloaded = {"LD_PRELOAD": str(faults)} if faults else {}
        self.disk_faults = faults is not None
        """Whether file operations can be made to fail."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.chaos.nursery"], cwd=_REPOSITORY, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
            env=os.environ | preloaded | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
        self._lock = threading.Lock()
        self._answer()

    def fork(self, wanted: dict[str, Any]) -> int:
        """Start a process and give its id."""
        with self._lock:
            if self._process.stdin is None:
                raise RuntimeError("the nursery has no stdin")
            self._process.stdin.write(json.dumps(wanted) + "\n")
            self._process.stdin.flush()
            return int(self._answer())

    def _answer(self) -> str:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise RuntimeError("the nursery died")
        return line

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()  # and with it all that it forked
        self._process.communicate()


class Part:
    """One process of the service and what is to be done to it."""

    def __init__(
        self, nursery: Nursery, name: str, arguments: Sequence[str], log: Path,
        environment: dict[str, str], *, writes_to: Path | None = None,
    ) -> None:
        self.name = name
        self.log = log
        self.starts = 0
        self.pid = -1
        self.wanted = True
        """False: is not started again."""
        self._nursery = nursery
        self._spec = {"arguments": [*arguments], "log": str(writes_to or log),
                      "environment": environment}
        self._handle = -1
        self._lock = threading.Lock()

    def start(self) -> None:
        """Start, unless it runs or is not wanted any more."""
        with self._lock:
            if self._handle == -1 and self.wanted:
                self.starts += 1
                self.pid = self._nursery.fork(self._spec)
                with contextlib.suppress(ProcessLookupError):  # it has ended already
                    self._handle = os.pidfd_open(self.pid)

    def running(self) -> bool:
        """Say whether it runs, stopped or not."""
        with self._lock:
            if self._handle == -1:
                return False
            try:
                signal.pidfd_send_signal(self._handle, 0)
            except ProcessLookupError:
                os.close(self._handle)
                self._handle = -1
                return False
            return True

    def send(self, number: signal.Signals) -> bool:
        """Send a signal; False where there is no process."""
        with self._lock:
            if self._handle == -1:
                return False
            try:
                signal.pidfd_send_signal(self._handle, number)
            except ProcessLookupError:
                return False
            return True

    def end(self, number: signal.Signals = signal.SIGTERM) -> None:
        """Stop for good and wait for it."""
        with self._lock:  # who is just starting it comes before or not at all
            self.wanted = False
        self.send(signal.SIGCONT)
        self.send(number)
        until(lambda: not self.running(), f"end of {self.name}")


class Child:
    """A process that `denseface up` runs, for as long as it is the same one."""

    def __init__(self, process: psutil.Process, name: str) -> None:
        self.name = name
        self._process = process

    def send(self, number: signal.Signals) -> bool:
        """Send a signal; False where it has ended."""
        try:
            self._process.send_signal(number)
        except psutil.NoSuchProcess:
            return False
        return True


class Cluster:
    """Runs the service's parts until the `with` block ends.

    Parameters
    ----------
    folder : of data, logs and tokens; stays
    source : what the capture process opens
    recon : further arguments of the hub
    daemons_at : where daemons connect, given the hub's address; by default there
    thief : takes ids at a listener with keys, where the first worker then connects
    supervised : run `denseface up` in place of its parts, which then restarts them
    """

    def __init__(
        self, nursery: Nursery, folder: Path, source: Path, *, workers: int = 1,
        recon: Sequence[str] = (), environment: dict[str, str] | None = None,
        actions: dict[str, str] | None = None,
        daemons_at: Callable[[str], str] = lambda address: address,
        thief: Thief | None = None, supervised: bool = False,
    ) -> None:
        self.data = folder / "data"
        self.logs = folder
        self._tokens = folder / "tokens"
        self._tokens.mkdir(parents=True)
        self.disk_order = folder / "disk-order" if nursery.disk_faults else None
        """Is there while `fail_disk` has not begun; None where nothing can be made to fail."""
        self._sockets = tempfile.TemporaryDirectory(prefix="df-")  # their paths must be short
        self.address = f"ipc://{self._sockets.name}/hub"
        self.fired: Counter[str] = Counter()
        points = dict.fromkeys(FAILPOINT_NAMES, "kill") | (actions or {})
        settings = PACE | (environment or {}) | {
            FAILPOINTS_VARIABLE: ",".join(f"{name}={action}" for name, action in points.items()),
            TOKENS_VARIABLE: str(self._tokens)}
        if self.disk_order:
            settings |= {"DISK_FAULTS_FOLDER": str(self.data),
                         "DISK_FAULTS_ORDER": str(self.disk_order)}

        def part(name: str, command: str, address: str, *arguments: str) -> Part:
            return Part(nursery, name, [command, "--address", address, *arguments],
                        folder / f"{name}.log", settings)

        self.hub_log = LogPipe(folder / "hub.pipe", folder / "hub.log")

        self._part = part
        self._workers = workers
        listen = thief.hub_arguments() if thief else []
        kept = ["--address", self.address, "--data", str(self.data), *listen, *recon]
        first = ["up", "--no-kiosk", "--source", str(source), "--workers", str(workers), *kept] if (
            supervised) else ["hub", *kept]
        # Of what is supervised, all processes write into that pipe.
        self.hub = Part(nursery, first[0], first, self.hub_log.log, settings,
                        writes_to=self.hub_log.path)
        self.supervised = supervised
        self.parts = [self.hub]
        if not supervised:
            elsewhere = daemons_at(self.address)
            self.parts.append(part("capture", "capture", elsewhere, "--source", str(source)))
            self.parts += [part(f"worker-{number}", "worker", elsewhere)
                           for number in range(1, workers + 1)]
            if thief:
                self.parts[2] = Part(nursery, "worker-1", ["worker", *thief.worker_arguments()],
                                     folder / "worker-1.log", settings)
        self._ended = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self.hub_log.open()
        self._watcher.start()
        self.ready()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.stop(signal.SIGTERM if error is None else signal.SIGKILL)
        finally:
            self._sockets.cleanup()

    def stop(self, number: signal.Signals = signal.SIGTERM) -> None:
        """End all, the hub last; harmless when repeated."""
        self._ended.set()
        self._watcher.join()
        self.hub_log.flow()
        for part in reversed(self.parts):
            part.end(number)
        self.hub_log.close()

    @property
    def capture(self) -> Part:
        """The capture process, where none is supervised."""
        return self.parts[1]

    @property
    def workers(self) -> list[Part]:
        """The workers, where none is supervised."""
        return [part for part in self.parts if part.name.startswith("worker")]

    def victims(self) -> Sequence[Part | Child]:
        """Give what a fault may befall: every process that runs."""
        if not self.supervised:
            return self.parts
        try:
            children = psutil.Process(self.hub.pid).children()
        except psutil.NoSuchProcess:
            children = []
        found = []
        for child in children:
            with contextlib.suppress(psutil.NoSuchProcess):
                names = [one for one in child.cmdline() if one in ("hub", "capture", "worker")]
                found += [Child(child, name) for name in names[:1]]
        return [self.hub, *found]

    def ready(self) -> None:
        """Wait until sensor and workers are there."""
        with Client(self.address) as client:
            def there() -> bool:
                try:
                    status = client.status(timeout=2 * PATIENCE)
                except ServiceError:
                    return False
                return bool(status.sensors) and len(status.workers) >= self._workers

            until(there, "sensor and workers")

    def add(self, name: str, command: str, *arguments: str) -> Part:
        """Run one more command beside the service."""
        added = self._part(name, command, self.address, *arguments)
        self.parts.append(added)
        return added

    def token(self, failpoint: str) -> Path:
        """Give the file that lets a failpoint act once."""
        return self._tokens / failpoint

    def let_fail(self, failpoint: str) -> None:
        """Let a failpoint act the next time that it is passed."""
        self.token(failpoint).touch()
        self.fired[failpoint] += 1

    def fail_disk(self, error: int, count: int) -> None:
        """Let the hub's next `count` file operations fail with an error number."""
        if self.disk_order is None:
            raise RuntimeError("this nursery cannot make file operations fail")
        beside = self.disk_order.with_suffix(".new")
        beside.write_text(f"{error} {count}")
        beside.replace(self.disk_order)

    def restarts(self) -> int:
        """Give how often a part was started again."""
        return sum(part.starts - 1 for part in self.parts if part.starts)

    def tracebacks(self) -> list[str]:
        """Give what ended a part by a fault of its own, or was logged as one."""
        found = []
        for part in self.parts:
            text = part.log.read_text(errors="replace") if part.log.exists() else ""
            if "Traceback" in text:
                found.append(f"{part.name}: {text[text.index('Traceback'):][-600:]}")
        return found

    def _watch(self) -> None:
        while not self._ended.wait(_WATCH_S):
            for part in self.parts:
                if part.wanted and not part.running():
                    part.start()
