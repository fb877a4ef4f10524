"""What a process and its supervisor tell each other."""

import os
import socket

import pytest

from denseface.service.runtime.watching.supervisor_link import (
    LINK_VARIABLE,
    Beat,
    ProcessLink,
    SupervisorLink,
)


@pytest.fixture
def ends():
    """Give the supervisor's end and the process's."""
    with ProcessLink() as process:
        environment = {LINK_VARIABLE: str(os.dup(process.descriptor))}
        with SupervisorLink.inherit(environment) as supervisor:
            process.started()
            assert environment == {}
            yield process, supervisor


def test_the_last_sign_of_life_counts(ends):
    process, supervisor = ends
    assert process.last_beat() is None
    for beat in (Beat.IDLE, Beat.HOLDING):
        supervisor.beat(beat)
    assert process.last_beat() is Beat.HOLDING
    assert process.last_beat() is None


def test_why_a_process_ends_is_heard_and_is_no_sign_of_life(ends):
    process, supervisor = ends
    supervisor.beat(Beat.HOLDING)
    supervisor.say_why("no such class \u00e9" + "x" * 1000)
    assert process.last_beat() is Beat.HOLDING
    assert process.why.startswith("no such class \u00e9xxx")
    assert len(process.why) < 500


def test_nobody_waits_for_who_does_not_read(ends):
    process, supervisor = ends
    for _ in range(10_000):
        supervisor.beat()
    assert process.last_beat() is Beat.IDLE
    while process.send_restarts({"x": {"hung": 1}}):
        pass


def test_the_newest_counts_are_read(ends):
    process, supervisor = ends
    assert supervisor.restarts() is None
    assert process.send_restarts({})
    assert process.send_restarts({"hub": {"exited": 2}})
    assert supervisor.restarts() == {"hub": {"exited": 2}}
    assert supervisor.restarts() is None


def test_what_the_dead_said_last_can_be_read(ends):
    process, supervisor = ends
    process.send_restarts({})  # is never read
    supervisor.beat(Beat.HOLDING)
    supervisor.close()
    assert process.last_beat() is Beat.HOLDING
    assert process.last_beat() is None
    assert not process.send_restarts({})


def test_a_process_outlives_its_supervisor(ends):
    process, supervisor = ends
    process.close()
    supervisor.beat()
    assert supervisor.restarts() is None


def test_what_is_no_sign_of_life_is_none(ends):
    process, supervisor = ends
    supervisor._end.send(b"?")
    assert process.last_beat() is None


@pytest.mark.parametrize("left", ["", "x", "-1", "9999999"])
def test_without_a_supervisor_nothing_is_said(left):
    with SupervisorLink.inherit({LINK_VARIABLE: left}) as supervisor:
        supervisor.beat(Beat.HOLDING)
        assert supervisor.restarts() is None


def test_what_is_no_socket_is_no_link(tmp_path):
    with (tmp_path / "file").open("w+b") as file:
        SupervisorLink.inherit({LINK_VARIABLE: str(file.fileno())}).beat()
    assert (tmp_path / "file").read_bytes() == b""


def test_the_link_goes_to_no_child(ends):
    _, supervisor = ends
    assert isinstance(supervisor._end, socket.socket)
    assert not supervisor._end.get_inheritable()
