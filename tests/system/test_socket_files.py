"""The hub's socket files are removed under it, as a log-out removes XDG_RUNTIME_DIR."""

import json
import re
import shutil
import socket
import stat
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zmq

from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet, encode
from tests.system.running import PACE, hub_alone
from tests.waiting import LIMIT_MS, LIMIT_S, until

_DEAF = "hub: nobody can connect"


@pytest.fixture
def run():
    """Where the sockets are."""
    with tempfile.TemporaryDirectory(prefix="df-") as folder:
        yield Path(folder) / "user" / "denseface"


@pytest.fixture
def log(run, tmp_path, monkeypatch):
    for name, value in PACE.items():
        monkeypatch.setenv(name, value)
    with hub_alone(f"ipc://{run}/hub", tmp_path / "data", "--metrics", "0") as log:
        until(lambda: "metrics" in log.read_text())
        yield log


@contextmanager
def raw(run: Path, kind: int, name: str = "hub") -> Iterator[zmq.Socket[bytes]]:
    with zmq.Context() as context, context.socket(kind) as connected:
        connected.linger = 0
        if kind == zmq.SUB:
            connected.subscribe("status")
        connected.connect(f"ipc://{run}/{name}")
        yield connected


def answers(connected: zmq.Socket[bytes]) -> bool:
    connected.send_multipart(encode(Packet(messages.GetStatus(request=1))))
    return bool(connected.poll(LIMIT_MS) and connected.recv_multipart())


def missing(log: Path) -> list[str]:
    """Give what `/healthz` misses: it answers 503, as there is no sensor."""
    url = re.search(r"http://[^/]*", log.read_text()).group()
    with pytest.raises(urllib.error.HTTPError, match="503") as refused:
        urllib.request.urlopen(f"{url}/healthz", timeout=LIMIT_S)  # noqa: S310
    found: list[str] = json.load(refused.value)["missing"]
    return found


def logged(log: Path, words: str) -> int:
    """Wait until something stands in the log, which is written a little later; say how often."""
    return until(lambda: log.read_text().count(words))


def remove(folder: Path) -> None:
    """Remove a folder at once: one file after the other, the hub would put them back meanwhile."""
    shutil.rmtree(folder.rename(folder.with_name("removed")))


def replace(run: Path) -> None:
    """Put a file where the folder was, which the hub may make again at any time."""
    while True:
        remove(run)
        try:
            run.touch(exist_ok=False)
        except FileExistsError:
            continue
        return


def test_a_hub_whose_folder_was_removed_listens_again(run, log):
    with raw(run, zmq.DEALER) as before:
        assert answers(before)
        remove(run.parent)
        until((run / "hub").is_socket)
        until((run / "hub.publications").is_socket)
        assert stat.S_IMODE(run.stat().st_mode) == 0o700
        with raw(run, zmq.DEALER) as after, raw(run, zmq.SUB, "hub.publications") as subscriber:
            assert answers(after)
            assert subscriber.poll(LIMIT_MS)
        assert answers(before)  # it was never cut off
    assert logged(log, "listening again") == 1


def test_a_hub_that_cannot_listen_again_is_not_healthy_and_goes_on_trying(run, log):
    assert not [one for one in missing(log) if one.startswith(_DEAF)]
    replace(run)
    until(lambda: [one for one in missing(log) if one.startswith(_DEAF)])
    run.unlink()
    with raw(run, zmq.DEALER) as after:
        assert answers(after)
    until(lambda: not [one for one in missing(log) if one.startswith(_DEAF)])
    assert logged(log, "nobody can connect") == 1


@pytest.mark.parametrize("name", ["hub", "hub.publications"])
def test_another_s_socket_at_its_place_is_left_alone(run, tmp_path, name):
    path = run / name
    with socket.socket(socket.AF_UNIX) as other:
        with hub_alone(f"ipc://{run}/hub", tmp_path / "data") as log:
            until(lambda: "listening" in log.read_text())
            other.bind(str(path) + ".new")
            other.listen()
            Path(f"{path}.new").replace(path)
            mine = path.stat().st_ino
            until(lambda: "another hub is listening there" in log.read_text())
        assert path.stat().st_ino == mine
