"""Whoever hangs is ended and started again; a frame that kills its worker costs itself alone."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
import zmq

from denseface.service.protocol.status import Restarts
from denseface.service.runtime.failpoints import FAILPOINTS_VARIABLE, TOKENS_VARIABLE
from tests.system.running import RECORDINGS, Service, service, wait_ready
from tests.waiting import LIMIT_MS, LIMIT_S, PATIENCE, until

_LIMIT_S = 2 * PATIENCE
_PACE = {"DENSEFACE_HANG_TIMEOUT_S": f"{_LIMIT_S:g}",
         "DENSEFACE_LIVENESS": f"{min(10 * PATIENCE, 100):.0f}"}
"""A process hangs after two seconds, and is gone for the hub after as long."""
_NO_SECOND_RESTART = """
from denseface.service import cli
from denseface.service.daemons import _watched_process
_watched_process._STORM_RESTARTS = 1
raise SystemExit(cli.main())
"""
"""A `denseface` whose second restart of one process is a storm."""


@contextmanager
def watched(folder: Path, program: Sequence[str] = ("-m", "denseface"), **environment: str,
            ) -> Iterator[Service]:
    with service(RECORDINGS / "frontal_700.oni", folder / "data", program=program,
                 environment=_PACE | environment) as up:
        yield up


@pytest.fixture(scope="module")
def up(tmp_path_factory):
    with watched(tmp_path_factory.mktemp("hangs")) as running:
        yield running


def one_of(up: Service, name: str) -> psutil.Process:
    (found,) = [one for one in up.family()[1:] if name in one.cmdline()]
    return found


def sum_of(restarts: dict[str, Restarts], reason: str) -> int:
    return sum(getattr(counts, reason) for counts in restarts.values())


def press_gives_a_face(up: Service, capture_id: str) -> None:
    pressed = up.run("press", "--id", capture_id, "--timeout", LIMIT_S)
    assert (pressed.returncode, pressed.stdout) == (0, f"{capture_id}\n"), (
        pressed.stderr + up.log.read_text())


@pytest.mark.parametrize(("name", "row"), [
    ("hub", "hub"), ("capture", "capture"), ("worker", "worker-1")])
def test_whoever_is_stopped_is_replaced(up, name, row):
    stopped = one_of(up, name)
    stopped.suspend()
    until(lambda: not stopped.is_running())
    wait_ready(up.address)
    press_gives_a_face(up, f"after-{name}")
    assert until(lambda: up.status().restarts.get(row)).hung >= 1
    assert f"{row} hung " in up.run("status").stdout


def test_a_supervisor_that_was_stopped_itself_kills_nobody(up):
    press_gives_a_face(up, "before")
    supervisor, *others = up.family()
    before = up.status().restarts
    capture = one_of(up, "capture")
    supervisor.suspend()
    with zmq.Context() as context, context.socket(zmq.SUB) as statuses:
        statuses.connect(f"{up.address}.publications")
        statuses.subscribe("status")
        for _ in range(round(2 * _LIMIT_S / 0.2)):  # one at each heartbeat
            assert statuses.poll(LIMIT_MS)
            statuses.recv_multipart()
    supervisor.resume()
    capture.kill()  # that it is replaced shows that the supervisor has looked
    until(lambda: sum_of(up.status().restarts, "exited") > sum_of(before, "exited"))
    assert sum_of(up.status().restarts, "hung") == sum_of(before, "hung")
    assert all(one.is_running() for one in others if one != capture)


def test_frames_that_kill_their_worker_cost_themselves_alone(tmp_path):
    poison = tmp_path / "worker.job.computing"
    poisoned = {FAILPOINTS_VARIABLE: f"{poison.name}=kill", TOKENS_VARIABLE: str(tmp_path),
                "DENSEFACE_ATTEMPTS": "1"}
    with watched(tmp_path, ("-c", _NO_SECOND_RESTART), **poisoned) as up, up.client() as client:
        for number in (1, 2):
            poison.touch()
            client.press(f"poison-{number}", timeout=LIMIT_S)
            until(lambda: not poison.exists())
        until(lambda: up.process.poll() is not None or client.status().dead == 2)
        assert up.process.poll() is None, up.log.read_text()
        press_gives_a_face(up, "next")
        assert client.status().restarts["worker-1"].exited == 2
