"""Monitors: the address of a connection that may be closed already, and floods of events."""

import socket
import threading
from pathlib import Path

import zmq

from denseface.service.monitoring import Rejections
from denseface.service.monitoring.figures import Counters
from denseface.service.transport.connection import ConnectionMonitor
from denseface.service.transport.handshakes import HandshakeMonitor, address_of
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


def test_a_flood_that_nobody_reads_does_not_hold_up_a_bind():
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        monitor = HandshakeMonitor(router, Rejections(Counters()))
        port = router.bind_to_random_port("tcp://127.0.0.1")
        for _ in range(1_500):  # three events each; a queue of libzmq holds 2,000
            socket.create_connection(("127.0.0.1", port)).close()
        address = router.get_string(zmq.LAST_ENDPOINT).rstrip("\0")
        bound = threading.Thread(
            target=lambda: (router.unbind(address), router.bind("tcp://127.0.0.1:*")), daemon=True)
        bound.start()
        bound.join(LIMIT_S)
        assert not bound.is_alive()
        monitor.close()


def test_a_client_that_did_not_look_for_long_can_be_closed():
    with zmq.Context() as context, socket.create_server(("127.0.0.1", 0)) as server:
        dealer = context.socket(zmq.DEALER)
        dealer.set(zmq.RECONNECT_IVL, 1)
        address = "tcp://{}:{}".format(*server.getsockname())
        monitor = ConnectionMonitor(dealer, address, None)
        dealer.connect(address)
        for _ in range(2_300):  # each a handshake that breaks off; a queue holds 2,000
            server.accept()[0].close()
        closed = threading.Thread(target=monitor.close, daemon=True)
        closed.start()
        closed.join(LIMIT_S)
        assert not closed.is_alive()
        dealer.close(linger=0)
