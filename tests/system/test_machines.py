"""Hub and sensor on one machine; worker, presser and programs in other languages on another.

Shown across two network namespaces where they can be made, and on every machine through a guarded
loopback address.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from denseface.service.client import Client
from denseface.service.export import load_face
from denseface.service.protocol.roles import Role
from denseface.service.security import allow, new_pair, read_public
from tests.ports import free_port
from tests.system import republished
from tests.system.programs import LANGUAGES, check_points, program
from tests.system.running import PACE, RECORDINGS, REPOSITORY
from tests.waiting import LIMIT_S, until

# Of this run alone: another on the same machine has addresses of its own.
_HERE, _THERE = (f"10.231.{os.getpid() % 256}.{os.getpid() // 256 % 63 * 4 + end}"
                 for end in (1, 2))


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@dataclass
class Machines:
    """Two machines, one of them with a running service."""

    local: str
    """Address of the hub for programs beside it."""
    guarded: tuple[str, Path, Path]
    """Address, key and the hub's key for programs elsewhere."""
    there: tuple[str, ...]
    """What goes before a command of the other machine."""
    environment: dict[str, str]
    hub_log: Path


@contextlib.contextmanager
def _network(kind: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Give the hub's host and what goes before a command of the other machine."""
    if kind == "loopback":
        yield "127.0.0.2", ()
        return
    name = f"df{os.getpid()}"
    with contextlib.ExitStack() as undo:
        try:
            _ip("netns", "add", name)
            undo.callback(_ip, "netns", "del", name)
            _ip("link", "add", f"{name}a", "type", "veth", "peer", "name", f"{name}b")
            undo.callback(subprocess.run, ["ip", "link", "del", f"{name}a"], capture_output=True,
                          check=False)
            _ip("link", "set", f"{name}b", "netns", name)
            _ip("addr", "add", f"{_HERE}/30", "dev", f"{name}a")
            _ip("link", "set", f"{name}a", "up")
            _ip("-n", name, "addr", "add", f"{_THERE}/30", "dev", f"{name}b")
            _ip("-n", name, "link", "set", f"{name}b", "up")
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no network namespaces can be made here: {error}")
        yield _HERE, ("ip", "netns", "exec", name)


@pytest.fixture(scope="module", params=["namespaces", "loopback"])
def machines(request, tmp_path_factory):
    """Run hub and sensor here and a worker there, and wait until they are ready."""
    here_keys, there_keys, work = (tmp_path_factory.mktemp(name)
                                   for name in ("hub", "bench", "work"))
    _, hub_key = new_pair(here_keys, "hub")
    secret, public = new_pair(there_keys, "bench")
    roles = frozenset({Role.WORKER, Role.PRESSER, Role.SUBSCRIBER})
    allow(here_keys, "bench", read_public(public), roles)
    environment = {name: value for name, value in os.environ.items()
                   if name != "DENSEFACE_ADDRESS"} | PACE
    with contextlib.ExitStack() as running:
        host, there = running.enter_context(_network(request.param))
        guarded = f"tcp://{host}:{free_port(host)}"
        folder = running.enter_context(tempfile.TemporaryDirectory(prefix="df-"))
        local = f"ipc://{folder}/hub"

        def start(*arguments: object, before: tuple[str, ...] = ()) -> Path:
            log = work / f"{arguments[0]}.log"
            process = subprocess.Popen(
                [*before, sys.executable, "-m", "denseface", *map(str, arguments)],
                cwd=REPOSITORY, env=environment, stderr=running.enter_context(log.open("w")))
            running.callback(process.wait, LIMIT_S)
            running.callback(process.terminate)
            return log

        # Few points are enough here: each face costs a third.
        hub_log = start("hub", "--address", local, "--listen", guarded, "--keys", here_keys,
                        "--data", work / "data", "--set", "ratio=2")
        start("capture", "--address", local, "--source", RECORDINGS / "frontal_700.oni")
        start("worker", "--hub", guarded, "--key", secret, "--hub-key", hub_key, before=there)
        with Client(local) as client:
            until(lambda: client.status(timeout=LIMIT_S).ready)
        yield Machines(local, (guarded, secret, hub_key), there, environment, hub_log)


def test_a_face_is_made_on_another_machine(machines, tmp_path):
    guarded, secret, hub_key = machines.guarded
    pressed = subprocess.run(
        [*machines.there, sys.executable, "-m", "denseface", "press", "--hub", guarded, "--key",
         str(secret), "--hub-key", str(hub_key), "--save", str(tmp_path / "face.npz")],
        cwd=REPOSITORY, env=machines.environment, check=False, capture_output=True, text=True,
        timeout=LIMIT_S)
    assert pressed.returncode == 0, machines.hub_log.read_text()
    (line,) = pressed.stderr.splitlines()  # what it wrote
    assert line.startswith(f"{tmp_path / 'face.npz'}: ")
    assert len(load_face(tmp_path / "face.npz").dense) > 10_000


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_program_in_another_language_presses_with_a_key_from_another_machine(
        machines, language, tmp_path):
    _press_and_check(language, machines, tmp_path, machines.there, machines.guarded)


@pytest.mark.parametrize("machines", ["loopback"], indirect=True)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_program_in_another_language_presses_beside_the_hub(machines, language, tmp_path):
    _press_and_check(language, machines, tmp_path, (), (machines.local,))


def _press_and_check(
    language: str, machines: Machines, folder: Path, before: tuple[str, ...],
    arguments: tuple[object, ...],
) -> None:
    (folder / "program").mkdir()
    command = [*before, *program(language, folder / "program"), *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True,
                          timeout=LIMIT_S)
    assert (done.returncode, done.stderr) == (0, "")
    (written,) = folder.glob("*.xyz")
    assert done.stdout.splitlines()[-1].startswith(f"{written.stem}: ")
    with Client(machines.local) as client:
        check_points(written, client.get(written.stem))


@pytest.mark.parametrize("machines", ["loopback"], indirect=True)
def test_the_program_in_javascript_says_that_its_key_is_refused(machines, tmp_path):
    guarded, _, hub_key = machines.guarded
    stranger, _ = new_pair(tmp_path / "keys", "stranger")
    done = subprocess.run(
        [*program("javascript", tmp_path), guarded, str(stranger), str(hub_key)], check=False,
        capture_output=True, text=True, timeout=LIMIT_S)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"{guarded}: the hub refuses this key\n"


@pytest.mark.parametrize("machines", ["loopback"], indirect=True)
def test_faces_are_handed_on_to_rerun_mcap_and_ros_2(machines, tmp_path, monkeypatch):
    """Each of the examples gets the last face, in this process, which has imported so much."""
    monkeypatch.setenv("DENSEFACE_ADDRESS", machines.local)
    with Client(machines.local) as client:
        face = client.get(client.press())

    republished.example("to_rerun")(str(tmp_path / "face.rrd"), "1")
    (points,) = republished.points_of_rerun(tmp_path / "face.rrd")
    republished.check(points, face)

    republished.example("to_mcap")(str(tmp_path / "face.mcap"), "1")
    (points,) = republished.points_of_mcap(tmp_path / "face.mcap")
    republished.check(points, face)

    ros = republished.FakeRos()
    for name, module in ros.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    republished.example("to_ros2")("1")
    assert ros.state == "down"
    assert [(topic, depth, kept.name) for topic, depth, kept in ros.topics] == [
        ("face", 1, "TRANSIENT_LOCAL")]
    (message,) = ros.published
    republished.check(republished.points_of_ros(message), face)
