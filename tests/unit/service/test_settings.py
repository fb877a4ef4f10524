"""Settings and addresses."""

import socket

import pytest

from denseface.service.client import AsyncClient, Client
from denseface.service.errors import AddressError, HubRunningError, SettingsError
from denseface.service.settings import ServiceSettings, default_address
from denseface.service.transport.addresses import (
    check_bindable,
    is_local,
    publications_of,
    socket_file,
)


def test_a_flag_wins_over_the_environment_and_that_over_the_default(tmp_path):
    environment = {"DENSEFACE_ATTEMPTS": "5", "DENSEFACE_DATA": "/somewhere", "OTHER": "1"}
    settings = ServiceSettings.of(environment, data=tmp_path, address=None)
    assert (settings.attempts, settings.data, settings.liveness) == (5, tmp_path, 3)


@pytest.mark.parametrize(("environment", "flags", "message"), [
    ({"DENSEFACE_ATTEMPTS": "0"}, {}, "DENSEFACE_ATTEMPTS: expected at least 1, found '0'"),
    ({"DENSEFACE_HEARTBEAT_S": "nan"}, {}, "DENSEFACE_HEARTBEAT_S"),
    ({}, {"job_timeout_s": -1}, "--job-timeout-s"),
])
def test_a_wrong_setting_is_named(environment, flags, message):
    with pytest.raises(SettingsError, match=message):
        ServiceSettings.of(environment, **flags)


def test_the_publications_are_beside_the_hub():
    assert publications_of("tcp://127.0.0.1:5000") == "tcp://127.0.0.1:5001"
    assert publications_of("tcp://[::1]:5000") == "tcp://[::1]:5001"
    assert publications_of("ipc:///run/x/hub") == "ipc:///run/x/hub.publications"


@pytest.mark.parametrize("address", [
    "", "hub", "tcp://", "tcp://127.0.0.1", "tcp://127.0.0.1:0", "tcp://127.0.0.1:65535",
    "tcp://127.0.0.1:99999", "tcp://127.0.0.1:5000/x", "ipc://relative", "ipc:///" + "x" * 100,
    "inproc://x", "tcp://[::1:5000"])
def test_malformed_addresses_are_named(address):
    with pytest.raises(AddressError, match="ipc"):
        socket_file(address)


@pytest.mark.parametrize(("address", "local"), [
    ("tcp://0.0.0.0:5000", False), ("tcp://192.168.1.2:5000", False),
    ("tcp://example.com:5000", False), ("tcp://[::]:5000", False), ("tcp://*:5000", False),
    ("tcp://127.0.0.1:5000", True), ("tcp://[::1]:5000", True), ("ipc:///run/hub", True)])
def test_what_others_can_reach_is_not_local(address, local):
    assert is_local(address) is local


def test_a_socket_in_use_is_not_taken_over(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as other:
        other.bind("hub")  # a relative name: the full path may be too long to bind
        path = tmp_path / "hub"
        if len(str(path)) > 90:
            pytest.skip(f"the temporary folder's path is too long for a socket: {tmp_path}")
        other.listen()
        with pytest.raises(HubRunningError, match="another hub"):
            check_bindable(f"ipc://{path}")
    check_bindable(f"ipc://{path}")  # left behind by one that was killed


def test_nobody_connects_by_a_default_folder_that_another_may_have_made(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "denseface").symlink_to(tmp_path / "elsewhere")
    for connect in (Client, lambda: AsyncClient(default_address())):
        with pytest.raises(SettingsError, match="must be a folder of user"):
            connect()
    (tmp_path / "denseface").unlink()
    with Client(), Client(f"ipc://{tmp_path}/elsewhere/hub"):
        assert (tmp_path / "denseface").stat().st_mode & 0o777 == 0o700
