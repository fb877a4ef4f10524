"""Why there is no hub at an address."""

import os
import pwd
import socket
from pathlib import Path

import pytest

from denseface.service.errors import AddressError
from denseface.service.transport import absence
from denseface.service.transport.absence import why_absent
from denseface.service.transport.addresses import check_connectable

ME = pwd.getpwuid(os.getuid()).pw_name


def bound(path: Path) -> socket.socket:
    one = socket.socket(socket.AF_UNIX)
    one.bind(str(path))
    return one


def why(path: Path) -> str:
    return why_absent(path)


def test_what_is_at_the_place_of_the_socket_is_said(tmp_path):
    path = tmp_path / "hub"
    assert why(path) == why(tmp_path / "no folder" / "hub") == (
        "there is no such socket file; is `denseface up` running?")
    with bound(path) as listening:
        listening.listen()
        assert why(path) == "something listens there and does not answer as a hub does"
    assert why(path) == (
        "the socket file is left of a hub that has ended; is `denseface up` running?")
    path.unlink()
    path.write_text("mine")
    assert why(path) == "there is a file of that name, and it is no socket"
    assert why_absent(None).startswith("nothing answers there, or the network does")


def test_another_users_socket_is_refused_at_once_by_its_owner(tmp_path, monkeypatch):
    path = tmp_path / "hub"
    with bound(path):
        path.chmod(0o700)
        check_connectable(f"ipc://{path}")
        monkeypatch.setattr(absence.os, "access", lambda *_: False)
        with pytest.raises(AddressError, match=rf"{path} belongs to the user {ME} \(mode 700\)"):
            check_connectable(f"ipc://{path}")
    assert "permission denied" in why(path)


def test_a_socket_in_another_users_folder_is_refused_at_once_by_its_owner(tmp_path, monkeypatch):
    folder = tmp_path / "theirs"
    folder.mkdir(0o700)
    look = Path.stat

    def stat(path, **how):
        if folder in path.parents:
            raise PermissionError(13, "Permission denied", str(path))
        return look(path, **how)

    monkeypatch.setattr(Path, "stat", stat)
    monkeypatch.setattr(absence.pwd, "getpwuid", {}.__getitem__)
    for path in (folder / "hub", folder / "deeper" / "hub"):
        with pytest.raises(AddressError, match=rf"permission denied: {folder} belongs to the user "
                                               rf"number {os.getuid()} \(mode 700\): a socket"):
            check_connectable(f"ipc://{path}")
