"""What clients and daemons do where there is no hub."""

import asyncio

import pytest
import zmq
from structlog.testing import capture_logs

from denseface.service.cli import main
from denseface.service.client import AsyncClient, Client, _hub_wait
from denseface.service.commands import _options
from denseface.service.errors import ClientTimeoutError, LocalProtocolError
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.settings import ServiceSettings
from denseface.service.transport import hub_connection
from denseface.service.transport.hub_connection import HubConnection
from tests.unit.service.fake_hub import FakeHub, fake_hub
from tests.waiting import LIMIT_S, until

NO_FILE = "there is no such socket file; is `denseface up` running?"


@pytest.fixture(autouse=True)
def _at_once(monkeypatch):
    monkeypatch.setattr(_hub_wait, "_SAY_S", 0.0)
    monkeypatch.setattr(hub_connection, "_SAY_ALONE_S", 0.0)


@pytest.fixture
def address(tmp_path):
    return f"ipc://{tmp_path}/hub"


def test_a_hub_that_is_not_there_is_said_once_and_why(address):
    said = []
    with Client(address, connect_timeout=0.2, on_waiting=said.append) as client:
        for call in (client.press, client.status):
            with pytest.raises(ClientTimeoutError) as missing:
                call(timeout=60)
            assert str(missing.value) == (
                f"{address}: no connection to the hub within 0.2 s: {NO_FILE}")
    assert said == [f"waiting for the hub at {address}: {NO_FILE}"]


def test_a_call_that_ends_before_the_first_connection_need_be_there_says_why_too(address):
    with Client(address, connect_timeout=LIMIT_S) as client, pytest.raises(
            ClientTimeoutError, match=r"no answer from the hub within 0\.1 s: ther"):
        client.status(timeout=0.1)


def test_a_time_that_is_none_is_refused(address):
    with pytest.raises(LocalProtocolError, match="expected seconds, found"):
        Client(address, connect_timeout="5")


def test_who_only_listens_and_who_awaits_says_it_too(address):
    said = []

    async def main():
        async with AsyncClient(address, on_waiting=said.append) as client:
            with pytest.raises(ClientTimeoutError, match=NO_FILE[:20]):
                await client.status(timeout=0.1)
            with pytest.raises(ClientTimeoutError, match=f"time allowed: {NO_FILE[:20]}"):
                await anext(client.hints(timeout=0.1))

    asyncio.run(main())
    with Client(address, on_waiting=said.append) as client, pytest.raises(ClientTimeoutError):
        next(client.hints(timeout=0.1))
    assert said == [f"waiting for the hub at {address}: {NO_FILE}"] * 2


def test_a_hub_that_is_there_and_silent_is_not_said_to_be_absent(monkeypatch):
    monkeypatch.setattr(_hub_wait, "_SAY_S", LIMIT_S)
    with fake_hub() as hub:
        hub.ignored = {"get_status"}
        with Client(hub.address, connect_timeout=LIMIT_S, on_waiting=pytest.fail) as client:
            assert client.press("a") == "a"
            with pytest.raises(ClientTimeoutError, match=r"it is there, and busy, or stopped$"):
                client.status(timeout=0.1)


def test_a_hub_that_was_there_is_waited_for_as_long_as_a_call_may_take(address):
    said = []
    first = FakeHub(address)
    with Client(address, connect_timeout=0.2, on_waiting=said.append) as client:
        try:
            assert client.press("a", timeout=LIMIT_S) == "a"
        finally:
            first.close()
        # What is sent before it has heard that the hub is gone waits for its answer.
        until(lambda: not client._socket.poll(0, zmq.POLLOUT))

        def waited():
            with pytest.raises(ClientTimeoutError, match=r"no answer from the hub within 0\.5 s"):
                client.press("b", timeout=0.5)
            return said

        until(waited)
        assert len(said) == 1
        again = FakeHub(address)
        try:
            assert client.press("b", timeout=LIMIT_S) == "b"
        finally:
            again.close()


@pytest.mark.parametrize("command", [["press"], ["get", "a"], ["list"], ["purge", "--all", "--yes"],
                                     ["dead", "list"]])
def test_commands_say_what_they_wait_for_and_end(address, command, capfd, monkeypatch):
    monkeypatch.setattr(_options, "CONNECT_S", 0.1)
    assert main([*command, "--address", address]) == 1
    assert capfd.readouterr() == ("", (
        f"denseface {command[0]}: waiting for the hub at {address}: {NO_FILE}\n"
        f"denseface {command[0]}: {address}: no connection to the hub within 0.1 s: {NO_FILE}\n"))


def test_a_daemon_says_once_that_it_waits_and_once_that_it_waits_no_longer(address):
    settings = ServiceSettings(address=address, heartbeat_s=0.01)
    hub = None
    with capture_logs() as log, StopSignal() as stop, WakePipe() as wake, \
            HubConnection(settings, "worker") as connection:
        try:
            for number, _ in enumerate(connection.packets(stop, wake)):
                if number == 10:
                    hub = FakeHub(address)
                if len(log) == 2:
                    break
        finally:
            if hub:
                hub.close()
    assert [(one["event"], one["address"], one.get("reason")) for one in log] == [
        ("waiting for the hub", address, NO_FILE), ("connected to the hub", address, None)]
