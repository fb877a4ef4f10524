"""What systemd is told, by a socket such as it listens on; all processes: tests/system."""

import os
import socket
import threading
from contextlib import suppress

import pytest

from denseface.service.daemons.supervisor import ProcessSpec, Supervisor
from denseface.service.runtime.watching.service_manager import ServiceManager
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


def test_what_is_not_taken_at_once_is_said_again_and_signs_of_life_are_not_heaped_up(systemd):
    """Where systemd is busy, its queue is full: who is ready says so only once."""
    listening, environment = systemd
    with ServiceManager(environment | {"WATCHDOG_USEC": "1"}) as manager:
        for _ in range(10_000):  # more than any queue holds
            manager.alive()
        manager.ready("first")
        manager.status("second")
        listening.setblocking(False)
        taken = drain(listening)
        assert set(taken) == {"WATCHDOG=1"}
        manager.alive()
        assert sorted(drain(listening)) == ["READY=1", "STATUS=second", "WATCHDOG=1"]
        manager.alive()
        assert drain(listening) == ["WATCHDOG=1"]


def test_who_does_not_listen_any_more_costs_nothing(systemd):
    listening, environment = systemd
    with ServiceManager(environment) as manager:
        listening.close()
        manager.ready("first")
        manager.status("second")
        manager.alive()


def drain(listening):
    said = []
    with suppress(BlockingIOError):
        while True:
            said.append(listening.recv(1000).decode())
    return said


class Said(ServiceManager):
    """Keeps what it says."""

    def __init__(self, limit_us="", clock=lambda: 0.0):
        super().__init__({"WATCHDOG_USEC": limit_us}, clock)
        self.said = []

    def _say(self, state):
        self.said.append(state)


def test_a_sign_of_life_is_passed_on_four_times_in_the_limit_however_often_it_is_given():
    clock = iter(range(101))
    manager = Said("40000000", lambda: float(next(clock)))
    for _ in range(101):
        manager.alive()
    assert manager.said == ["WATCHDOG=1"] * 11


def test_without_a_watchdog_no_sign_of_life_is_given():
    manager = Said()
    manager.alive()
    manager.need(60.0)
    assert manager.said == []


def test_a_limit_below_what_a_process_needs_is_raised_and_never_lowered():
    manager = Said("1000000")
    manager.need(3.0)
    manager.need(2.0)
    assert (manager.said, manager.limit_s) == (["WATCHDOG_USEC=3000000"], 3.0)


def test_a_start_is_prolonged_by_each_step_and_by_no_repetition():
    manager = Said()
    for done in (1, 1, 2):
        manager.step(f"{done} of 3", 5.0)
    assert manager.said == ["STATUS=1 of 3", "EXTEND_TIMEOUT_USEC=5000000",
                            "STATUS=2 of 3", "EXTEND_TIMEOUT_USEC=5000000"]


def test_ready_is_said_once_and_a_status_is_one_line_that_is_news():
    manager = Said()
    manager.ready()
    manager.ready("a\nREADY=1 b")
    manager.status("a READY=1  b")
    manager.status("x" * 1000)
    manager.status("")
    assert manager.said == ["READY=1", "STATUS=a READY=1 b", f"STATUS={'x' * 200}"]


@pytest.mark.parametrize("environment", [
    {}, {"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "soon"}, {"NOTIFY_SOCKET": "x" * 500}])
def test_where_nobody_listens_nothing_is_said(environment):
    with ServiceManager(environment) as manager:
        manager.alive()
        manager.ready("of use")
        assert manager.limit_s is None
        assert environment == {}
