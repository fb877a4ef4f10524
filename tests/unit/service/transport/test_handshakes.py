"""Monitors: the address of a connection that may be closed already, and floods of events."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.service.transport.handshakes import address_of
from tests.waiting import LIMIT_S


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


_FLOODED_HUB = """
with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
    monitor = HandshakeMonitor(router, Rejections(Counters()), RoutingIds())
    port = router.bind_to_random_port("tcp://127.0.0.1")
    for _ in range(1_500):  # three events each; a queue of libzmq holds 2,000
        socket.create_connection(("127.0.0.1", port)).close()
    router.unbind(router.get_string(zmq.LAST_ENDPOINT).rstrip("\\0"))
    router.bind("tcp://127.0.0.1:*")
    monitor.close()
"""
_FLOODED_CLIENT = """
with zmq.Context() as context, socket.create_server(("127.0.0.1", 0)) as server:
    dealer = context.socket(zmq.DEALER)
    dealer.set(zmq.RECONNECT_IVL, 1)
    address = "tcp://{}:{}".format(*server.getsockname())
    monitor = ConnectionMonitor(dealer, address, None)
    dealer.connect(address)
    for _ in range(2_300):  # each a handshake that breaks off; a queue holds 2,000
        server.accept()[0].close()
    monitor.close()
    dealer.close(linger=0)
"""


@pytest.mark.parametrize("code", [_FLOODED_HUB, _FLOODED_CLIENT], ids=["hub", "client"])
def test_events_that_nobody_reads_hold_nothing_up(code):
    # In a process of its own: one that libzmq holds up cannot even be interrupted.
    imports = """
import socket
import zmq
from denseface.service.monitoring import Rejections
from denseface.service.monitoring.figures import Counters
from denseface.service.transport.connection import ConnectionMonitor
from denseface.service.transport._routing_ids import RoutingIds
from denseface.service.transport.handshakes import HandshakeMonitor
"""
    subprocess.run([sys.executable, "-c", imports + code], check=True, timeout=LIMIT_S)
