"""The command line and the whole service as real processes."""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import psutil

from denseface.service.cli import main
from denseface.service.client import Client
from denseface.service.errors import ServiceError
from denseface.service.protocol.messages import Status
from denseface.service.runtime.failpoints import FAILPOINTS_VARIABLE, TOKENS_VARIABLE
from denseface.service.tools.status import ready_status
from tests import nursery
from tests.nursery import Forked
from tests.waiting import LIMIT_S, PATIENCE, until

REPOSITORY = Path(__file__).resolve().parents[2]
RECORDINGS = REPOSITORY / "fixtures" / "recorded_oni"
PACE = {"DENSEFACE_HEARTBEAT_S": "0.2", "DENSEFACE_LIVENESS": f"{min(15 * PATIENCE, 100):.0f}"}
"""Short heartbeats, so that a test soon sees a change; a process counts as gone after the default
3 s, since a busy machine stops one for longer than three of these heartbeats."""


_STOP = "worker.job.computing"
"""Where a worker stops once for each file of this name beside the service's data."""


def stopping(data: Path) -> dict[str, str]:
    """Give the environment of a service that has `Service.stop_worker_amid_a_job`."""
    return {FAILPOINTS_VARIABLE: f"{_STOP}=stop", TOKENS_VARIABLE: str(data.parent)}


_SLOW = re.compile(
    r"^(Ctrl-C ends it; |calibrating by |removing |looking at |reconstructing: ).* \.\.\.\n", re.M)
"""What a command says where it takes long, as all may on a busy machine."""


def denseface(*arguments: object, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run one command to its end; its stderr is without what is said of a slow machine."""
    done = nursery.run(["-m", "denseface", *arguments], cwd=REPOSITORY, timeout=1.5 * LIMIT_S,
                       env=os.environ | environment)
    done.stderr = _SLOW.sub("", done.stderr)
    return done


@contextmanager
def killed_at_the_end(process: "subprocess.Popen[str]") -> Iterator["subprocess.Popen[str]"]:
    """Give a process, and kill it at the end, whatever ends the block.

    `Popen` alone waits there: for ever, where a test failed that the process waits for.
    """
    with process:
        try:
            yield process
        finally:
            process.kill()


def run_here(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run one command in this process, which is warm: a second or two less."""
    given = [str(one) for one in arguments]
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            status = main(given)
        except SystemExit as exited:
            status = int(exited.code or 0)
    return subprocess.CompletedProcess(given, status, out.getvalue(), err.getvalue())


def wait_ready(address: str) -> Status:
    """Wait until a press would become a face, as `denseface status --wait` does."""
    with Client(address) as client:
        return ready_status(client, LIMIT_S)


@dataclass
class Service:
    """A running `denseface up`."""

    process: "subprocess.Popen[str]"
    address: str
    data: Path
    log: Path

    def run(self, *arguments: object) -> "subprocess.CompletedProcess[str]":
        return denseface(*arguments, "--address", self.address)

    def client(self) -> Client:
        return Client(self.address)

    def status(self) -> Status:
        with self.client() as client:
            return client.status()

    def family(self) -> list[psutil.Process]:
        up = psutil.Process(self.process.pid)
        return [up, *up.children(recursive=True)]

    def worker(self) -> psutil.Process:
        """Give the process of the only worker, once there is one alone and it lives."""
        def only() -> psutil.Process | None:
            pids = [int(name.rpartition("/")[2]) for name in self.status().workers]
            return psutil.Process(*pids) if len(pids) == 1 and psutil.pid_exists(*pids) else None

        worker = until(only)
        assert worker
        return worker

    def stop_worker_amid_a_job(self) -> psutil.Process:
        """Have the only worker stop itself at its next job, and give it.

        The service has the environment of `stopping`. Stopped by the test before the job, the
        worker could be gone for the hub by then.
        """
        worker = self.worker()
        (self.data.parent / _STOP).touch()
        return worker


@contextmanager
def service(
    source: Path | str, data: Path, *arguments: object, ready: bool = True,
    environment: dict[str, str] | None = None, program: Sequence[str] = ("-m", "denseface"),
) -> Iterator[Service]:
    """Run `denseface up` and make sure that nothing of it stays."""
    with tempfile.TemporaryDirectory(prefix="df-") as folder:  # socket paths must be short
        address = f"ipc://{folder}/hub"
        log = data.with_suffix(".log")
        with log.open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, *program, "up", "--source", str(source), "--data", str(data),
                 "--address", address, "--workers", "1", *map(str, arguments)],
                cwd=REPOSITORY, stderr=stderr, text=True,
                env=os.environ | PACE | (environment or {}))
        running = Service(process, address, data, log)
        try:
            if ready:
                try:
                    wait_ready(address)
                except ServiceError as error:
                    raise AssertionError(f"{error}\n{log.read_text()}") from error
            yield running
        finally:
            if process.poll() is None:
                family = running.family()
                process.terminate()
                psutil.wait_procs(family, timeout=LIMIT_S)
                for one in family:
                    if one.is_running():
                        one.kill()
            process.wait()


def sockets(running: Service) -> list[Path]:
    """Give the socket files there are."""
    folder = Path(running.address.removeprefix("ipc://")).parent
    return [path for path in folder.iterdir() if path.is_socket()]


PATIENT = {"DENSEFACE_LIVENESS": "100"}
"""For a hub whose peers are of the test and say no more than they have to: none is soon gone."""


@contextmanager
def hub_alone(
    address: str, data: Path, *arguments: str, code: str = "", **environment: str
) -> Iterator[Path]:
    """Run `denseface hub`, give its log, and stop it in order.

    Parameters
    ----------
    code : Python that runs in the hub's process before the hub does
    """
    log = data.with_suffix(".log")
    with log.open("w") as stderr:
        process = Forked(
            ["-c", f"import sys\n{code}\n"
             "from denseface.service.cli import main\nsys.exit(main(sys.argv[1:]))",
             "hub", "--address", address, "--data", data, *arguments],
            cwd=REPOSITORY, stderr=stderr, env=os.environ | environment)
    try:
        yield log
    finally:
        process.terminate()
        assert process.wait(LIMIT_S) == 0
