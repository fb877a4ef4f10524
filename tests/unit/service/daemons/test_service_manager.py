"""What systemd is told, by a socket such as it listens on."""

import os
import socket
import threading

import pytest

from denseface.service.daemons.service_manager import ServiceManager
from denseface.service.daemons.supervisor import ProcessSpec, Supervisor
from tests.waiting import LIMIT_S


@pytest.fixture
def systemd():
    """Give a listening socket, and the environment that names it."""
    name = f"denseface-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(f"\0{name}")
        listening.settimeout(LIMIT_S)
        yield listening, {"NOTIFY_SOCKET": f"@{name}", "WATCHDOG_USEC": "400000",
                          "WATCHDOG_PID": "1", "HOME": "/"}


def test_it_hears_that_the_supervisor_lives_is_ready_and_stops(systemd, tmp_path, monkeypatch):
    listening, environment = systemd
    hub = tmp_path / "hub"
    hub.write_text('#!/bin/bash\nprintf i >&"$DENSEFACE_SUPERVISOR"\nread -r < "$0.gate"\nexit 2\n')
    hub.chmod(0o700)
    gate = tmp_path / "hub.gate"
    os.mkfifo(gate)
    monkeypatch.setattr("denseface.service.daemons._watched_process.sys.executable", str(hub))
    heard = []

    def listen():
        while "READY=1" not in heard or heard[-2:] != ["WATCHDOG=1"] * 2:
            heard.append(listening.recv(100).decode())
        gate.write_text("go on\n")

    listener = threading.Thread(target=listen)
    listener.start()
    with ServiceManager(environment) as manager:
        assert environment == {"HOME": "/"}
        assert Supervisor([ProcessSpec("hub", ())], 60.0, manager).run() == 2
    listener.join()
    while heard[-1] != "STOPPING=1":
        heard.append(listening.recv(100).decode())
    assert heard.count("READY=1") == 1


@pytest.mark.parametrize("environment", [
    {}, {"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "soon"}, {"NOTIFY_SOCKET": "x" * 500}])
def test_where_nobody_listens_nothing_is_said(environment):
    with ServiceManager(environment) as manager:
        manager.say("WATCHDOG=1")
        assert manager.limit_s is None
