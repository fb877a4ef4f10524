"""The address of a connection, by a descriptor that may be closed already."""

import socket
from pathlib import Path

from denseface.service.transport.handshakes import address_of


def test_a_connection_is_named_by_its_other_end():
    with socket.create_server(("127.0.0.1", 0)) as server, \
            socket.create_connection(server.getsockname()) as client:
        accepted, _ = server.accept()
        with accepted:
            assert address_of(accepted.fileno()) == "{}:{}".format(*client.getsockname())


def test_a_number_that_is_something_else_by_now_has_no_address(tmp_path):
    one, other = socket.socketpair()
    with one, other, (tmp_path / "file").open("w") as file, socket.socket() as unconnected:
        before = len(list(Path("/proc/self/fd").iterdir()))
        for number in (one.fileno(), file.fileno(), unconnected.fileno(), 999_999):
            assert address_of(number) == "gone"
        assert len(list(Path("/proc/self/fd").iterdir())) == before
