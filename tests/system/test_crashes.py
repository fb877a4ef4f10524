"""Processes are killed, stopped, cut off and lied to; the history of each run is checked."""

import errno
import shutil
import signal
import subprocess
import sys
from contextlib import ExitStack

import psutil
import pytest
import zmq

from denseface.service.protocol.topics import Topic
from denseface.service.runtime.failpoints import FAILPOINT_NAMES
from denseface.service.storage import FolderLayout
from denseface.service.transport.addresses import publications_of
from tests.chaos.cluster import Nursery, Part, until
from tests.chaos.disk import compile_faults
from tests.chaos.history import Answer, violations
from tests.chaos.proxy import Proxy
from tests.chaos.scene import Scene
from tests.chaos.source import CHEAP, write_small_frame
from tests.system.running import REPOSITORY
from tests.waiting import PATIENCE

PATIENT = {"DENSEFACE_LIVENESS": "15"}
"""For scenes in which a press is refused only for the reason at hand: a sensor that a busy machine
stopped for half a second would be given up."""


@pytest.fixture(scope="module", autouse=True)
def quick_client():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DENSEFACE_RESEND_S", "0.3")
        yield


@pytest.fixture(scope="module")
def nursery(tmp_path_factory):
    # Without a C compiler no file operation can be made to fail.
    faults = compile_faults(tmp_path_factory.mktemp("faults")) if shutil.which("cc") else None
    with Nursery(faults) as one:
        yield one


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    path = tmp_path_factory.mktemp("source") / "frame.npz"
    write_small_frame(path)
    return path


@pytest.fixture
def scene(nursery, frame, tmp_path):
    with ExitStack() as stack:
        def start(**options) -> Scene:
            return stack.enter_context(
                Scene(nursery, tmp_path / "run", frame, recon=CHEAP, **options))
        yield start


def check(scene: Scene, **states: int) -> None:
    """No promise was broken, nobody fell over by himself, and captures ended as stated."""
    history = scene.finish()
    assert violations(history) == []
    assert scene.cluster.tracebacks() == []
    for state, count in states.items():
        assert [one.state for one in history.kept].count(state) == count


def fail_at(scene: Scene, failpoint: str, presses: int = 1) -> None:
    scene.cluster.let_fail(failpoint)
    scene.press(failpoint.replace(".", "-"), presses)
    until(lambda: not scene.cluster.token(failpoint).exists(), failpoint)


def is_stopped(part: Part) -> bool:
    return psutil.Process(part.pid).status() == psutil.STATUS_STOPPED


# The longest of all here: a minute where the disk is slow and the machine busy.
@pytest.mark.timeout(300)
def test_a_kill_at_each_step_of_a_capture_s_life(scene):
    running = scene()
    for name in FAILPOINT_NAMES:
        fail_at(running, name, presses=2)
        running.settle()
    assert running.cluster.restarts() == len(FAILPOINT_NAMES)
    check(running)


def test_whoever_hangs_is_given_up_and_may_come_back_late(scene):
    stops = {"worker.job.computed": "stop", "hub.frame.renamed": "stop", "hub.face.synced": "stop",
             "capture.frame.taken": "stop"}
    running = scene(workers=2, actions=stops)
    fail_at(running, "worker.job.computed")
    running.settle()  # by the other worker
    (late,) = [one for one in running.cluster.workers if is_stopped(one)]
    late.send(signal.SIGCONT)
    until(lambda: "not asked for" in running.cluster.hub.log.read_text(), "the late result")
    for name in ("hub.frame.renamed", "hub.face.synced"):
        fail_at(running, name)
        until(lambda: is_stopped(running.cluster.hub), "stop of the hub")
        running.press(f"{name.replace('.', '-')}-meanwhile")
        with pytest.raises(TimeoutError):
            running.settle(1.0)  # longer than the liveness of everyone
        running.cluster.hub.send(signal.SIGCONT)
        running.settle()
    fail_at(running, "capture.frame.taken")
    refused = running.pressers[-1]
    until(lambda: Answer.REFUSED in refused.answers.copy().values(), "refusal")
    running.cluster.capture.send(signal.SIGCONT)
    running.settle()
    check(running, done=6)


def test_a_full_disk_refuses_presses_and_keeps_what_was_accepted(scene):
    full = {"hub.frame.written": "raise:EIO", "hub.frame.synced": "raise:ENOSPC",
            "hub.frame.renamed": "raise:EIO",
            "hub.face.written": "raise:ENOSPC", "hub.face.renamed": "raise:EIO"}
    running = scene(actions=full, environment=PATIENT)
    for name, reason in (("hub.frame.written", "the disk fails"),
                         ("hub.frame.synced", "no room on the disk")):
        fail_at(running, name)
        running.settle()
        (said,) = running.pressers[-1].reasons
        assert reason in said
    for name in ("hub.frame.renamed", "hub.face.written", "hub.face.renamed"):
        fail_at(running, name, presses=2)
        running.settle()
        assert running.pressers[-1].reasons == []
    check(running, done=8, dead=0)
    assert not FolderLayout(running.cluster.data).listing().temporary


def test_a_disk_that_fails_in_runs_breaks_no_promise(scene, nursery):
    if not nursery.disk_faults:
        pytest.skip("there is no C compiler (cc) to build the library that makes operations fail")
    running = scene(environment=PATIENT)
    for number, (error, count) in enumerate((
            (errno.EIO, 2), (errno.EIO, 4), (errno.ENOSPC, 3), (errno.EIO, 12))):
        running.cluster.fail_disk(error, count)
        running.press(f"run{number}", 2)
        until(lambda: not running.cluster.disk_order.exists(), "a file operation")
        running.settle()
        running.cluster.hub.end(signal.SIGKILL)
        running.cluster.hub.wanted = True
    check(running)


def test_spoiled_frames_end_as_dead_letters_and_the_rest_goes_on(scene):
    running = scene(environment=PATIENT)
    running.cluster.workers[0].end()
    pressed = running.press("p", 3)
    until(pressed.done, "three accepted presses")
    running.cluster.hub.end(signal.SIGKILL)
    first, second, _ = pressed.answers
    layout = FolderLayout(running.cluster.data)
    with layout.frame(first).open("r+b") as file:
        file.truncate(1000)
    spoiled = bytearray(layout.frame(second).read_bytes())
    spoiled[5000] ^= 1
    layout.frame(second).write_bytes(spoiled)
    running.damaged |= {first, second}
    for part in running.cluster.parts:
        part.wanted = True
    running.settle()
    check(running, done=1, dead=2)
    reports = list(layout.quarantine.glob("*.json"))
    assert len(reports) == 2


@pytest.mark.parametrize("seed", [1, 2])
def test_messages_are_lost_doubled_and_reordered(scene, seed):
    with ExitStack() as stack:
        proxies = []

        def between(hub: str) -> str:
            proxies.append(stack.enter_context(
                Proxy(hub, seed, lose=0.03, double=0.15, delay=0.15)))
            return proxies[0].address

        running = scene(workers=2, daemons_at=between)
        for name in ("a", "b"):
            running.press(name, 15)
        running.settle()
        check(running)
        assert all(proxies[0].counts[fate] for fate in ("lost", "doubled", "delayed", "passed"))


def test_frames_that_kill_their_worker_end_as_dead_letters_and_the_rest_goes_on(scene):
    attempts = 2
    running = scene(environment=PATIENT | {"DENSEFACE_ATTEMPTS": str(attempts)})
    (worker,) = running.cluster.workers
    token = running.cluster.token("worker.job.computing")
    # For all deaths at once: a worker that is back before the next token is there would survive.
    token.write_bytes(b"." * (2 * attempts - 1))
    pressed = running.press("poison", 2)
    until(pressed.done, "two accepted presses")
    until(lambda: not token.exists(), "the last death")
    running.settle()
    running.press("after")
    running.settle()
    assert worker.starts == 1 + 2 * attempts
    assert running.cluster.hub.starts == 1
    check(running, done=1, dead=2)


def test_slow_and_dead_subscribers_hurt_only_themselves(scene):
    running = scene()
    with zmq.Context() as context, context.socket(zmq.SUB) as deaf:
        deaf.set(zmq.RCVHWM, 1)
        deaf.set(zmq.LINGER, 0)
        deaf.subscribe(Topic.FACES)
        deaf.connect(publications_of(running.cluster.address))
        stopped = running.cluster.add("subscriber", "subscribe", "--after", "0")
        running.press("first")
        running.settle()
        until(lambda: "first-1" in stopped.log.read_text(), "the subscriber's first face")
        stopped.send(signal.SIGSTOP)
        for name in ("a", "b"):
            running.press(name, 40)
        running.settle()
        stopped.send(signal.SIGCONT)
        until(lambda: all(f" {one} " in stopped.log.read_text() for presser in running.pressers
                          for one in presser.answers), "all that it missed")
        check(running, done=81)


def test_a_worker_told_to_stop_hands_back_what_it_cannot_finish(scene):
    running = scene(actions={"worker.job.computing": "hang"},
                    environment={"DENSEFACE_HEARTBEAT_S": "1"})
    fail_at(running, "worker.job.computing")
    (worker,) = running.cluster.workers
    worker.end()
    assert "job handed back" in worker.log.read_text()
    worker.wanted = True
    running.settle()
    log = running.cluster.hub.log
    until(lambda: log.read_text().count("attempt=1") == 2, "both times in the log")
    assert "attempt=2" not in log.read_text()
    check(running, done=1)


@pytest.mark.timeout(300)
def test_a_storm_prints_its_table(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-m", "tests.chaos", "--presses", "40", "--seed", "3", "--keep",
         str(tmp_path)], cwd=REPOSITORY, capture_output=True, text=True, check=False,
        timeout=280 * PATIENCE)
    assert ended.returncode == 0, ended.stderr
    assert "| presses accepted | 40 |" in ended.stdout
    assert "| **promises broken** | **0** |" in ended.stdout
    assert list(tmp_path.iterdir()) == []
