"""Hub and sensor on one machine, worker and presser on another.

Shown across two network namespaces where they can be made, and on every machine through a guarded
loopback address.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from denseface.service.client import Client
from denseface.service.export import load_face
from denseface.service.protocol.roles import Role
from denseface.service.security import allow, new_pair, read_public
from tests.ports import free_port
from tests.system.running import PACE, RECORDINGS, REPOSITORY
from tests.waiting import LIMIT_S, until

# Of this run alone: another on the same machine has addresses of its own.
_HERE, _THERE = (f"10.231.{os.getpid() % 256}.{os.getpid() // 256 % 63 * 4 + end}"
                 for end in (1, 2))


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture(params=["namespaces", "loopback"])
def machines(request):
    """Give the hub's address and what goes before a command of the other machine."""
    if request.param == "loopback":
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


def test_a_face_is_made_on_another_machine(machines, tmp_path):
    host, there = machines
    here_keys, there_keys = tmp_path / "hub", tmp_path / "bench"
    _, hub_key = new_pair(here_keys, "hub")
    secret, public = new_pair(there_keys, "bench")
    roles = frozenset({Role.WORKER, Role.PRESSER})
    allow(here_keys, "bench", read_public(public), roles)
    guarded = f"tcp://{host}:{free_port(host)}"
    to_hub = ("--hub", guarded, "--key", str(secret), "--hub-key", str(hub_key))
    environment = {name: value for name, value in os.environ.items()
                   if name != "DENSEFACE_ADDRESS"} | PACE
    with tempfile.TemporaryDirectory(prefix="df-") as folder, contextlib.ExitStack() as running:
        local = f"ipc://{folder}/hub"

        def start(*arguments: object, before: tuple[str, ...] = ()) -> Path:
            log = tmp_path / f"{arguments[0]}.log"
            process = subprocess.Popen(
                [*before, sys.executable, "-m", "denseface", *map(str, arguments)],
                cwd=REPOSITORY, env=environment, stderr=running.enter_context(log.open("w")))
            running.callback(process.wait, 20)
            running.callback(process.terminate)
            return log

        hub_log = start("hub", "--address", local, "--listen", guarded, "--keys", here_keys,
                        "--data", tmp_path / "data")
        start("capture", "--address", local, "--source", RECORDINGS / "frontal_700.oni")
        start("worker", *to_hub, before=there)
        with Client(local) as client:
            until(lambda: client.status(timeout=LIMIT_S).ready)
        pressed = subprocess.run(
            [*there, sys.executable, "-m", "denseface", "press", *to_hub, "--save",
             str(tmp_path / "face.npz")], cwd=REPOSITORY, env=environment, check=False,
            capture_output=True, text=True, timeout=LIMIT_S)
        assert pressed.returncode == 0, hub_log.read_text()
        (line,) = pressed.stderr.splitlines()  # what it wrote
        assert line.startswith(f"{tmp_path / 'face.npz'}: ")
    assert len(load_face(tmp_path / "face.npz").dense) > 10_000
