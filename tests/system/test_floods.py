"""More connections than anybody needs: with one key, without a key, at the local door."""

import socket
from contextlib import ExitStack, closing, suppress

import psutil
import pytest
import zmq

from denseface.service.protocol import messages
from denseface.service.protocol.roles import Role
from denseface.service.protocol.wire import Packet, encode
from denseface.service.security import allow, read_pair, read_public, revoke
from tests.system.guarded import Peer, guarded_hub, happened, press_through
from tests.waiting import LIMIT_MS, LIMIT_S, until

_FEW_DESCRIPTORS = """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (512, 512))
"""


@pytest.fixture
def hub(tmp_path):
    with guarded_hub(tmp_path) as running:
        yield running


def connections(stack, hub, key, number):
    """Open raw connections of one key, all of them by one context."""
    context = stack.enter_context(zmq.Context())
    pair, server = read_pair(hub.secret(key)), read_public(hub.hub_key)
    opened = []
    for _ in range(number):
        dealer = context.socket(zmq.DEALER)
        dealer.curve_serverkey = server.encode()
        dealer.curve_publickey = pair.public.encode()
        dealer.curve_secretkey = pair.secret.encode()
        dealer.linger = 0
        stack.enter_context(dealer)
        dealer.connect(hub.address)
        opened.append(dealer)
    return opened


def test_one_key_does_not_take_the_places_of_the_others(hub):
    ready = encode(Packet(messages.WorkerReady(name="many", credit=0)))
    with ExitStack() as stack:
        for dealer in connections(stack, hub, "worker", 300):
            dealer.send_multipart(ready)
        until(lambda: hub.refused("connections"))
        hub.new_key("other", "worker")
        other = stack.enter_context(closing(hub.peer("other")))
        other.send(messages.WorkerReady(name="other", credit=0))
        until(lambda: "other" in hub.status().workers)
        assert "[error" not in hub.log.read_text()


def test_one_key_connects_only_so_often(hub):
    # So nobody can try the routing ids that libzmq may give next, among 2^32.
    with ExitStack() as stack:
        # Some hundreds: more where that takes so long that others may come meanwhile.
        while not hub.refused("connections"):
            with ExitStack() as once:
                for dealer in connections(once, hub, "worker", 90):
                    dealer.send_multipart(encode(Packet(messages.GetStatus(request=1))))
                    until(lambda one=dealer: one.poll(100) or hub.refused("connections"))
        other = stack.enter_context(closing(hub.peer("presser")))
        assert happened(other, zmq.Event.HANDSHAKE_SUCCEEDED)
        assert other.status()


_WAITS_TO_CUT = """
import time
from pathlib import Path
from denseface.service.transport._bound_socket import BoundSocket
cut = BoundSocket.cut
def late(self):
    folder = Path({folder!r})
    (folder / "cutting").touch()
    while not (folder / "flooded").exists():
        time.sleep(0.01)
    cut(self)
BoundSocket.cut = late
"""


def test_a_key_comes_and_goes_while_connections_break_off(tmp_path):
    # libzmq's thread would wait to report them, with a lock that the hub needs to bind again.
    with (guarded_hub(tmp_path, code=_WAITS_TO_CUT.format(folder=str(tmp_path))) as hub,
          closing(hub.peer("subscriber", zmq.SUB)) as peer):
        public = read_public(hub.keys / "subscriber.public")
        peer.socket.subscribe("status")
        assert peer.socket.poll(LIMIT_MS)
        revoke(hub.keys, "subscriber")
        until((tmp_path / "cutting").exists)
        port = int(hub.address.rpartition(":")[2]) + 1
        for _ in range(800):  # three events each; a queue of libzmq holds 2000
            socket.create_connection(("127.0.0.1", port), LIMIT_S).close()
        (tmp_path / "flooded").touch()
        assert hub.status()
        allow(hub.keys, "subscriber", public, frozenset({Role.SUBSCRIBER}))
        with closing(hub.peer("subscriber", zmq.SUB)) as again:
            again.socket.subscribe("status")
            assert again.socket.poll(LIMIT_MS)


def flood(stack, family, address, number):
    """Open raw connections that say nothing, as fast as they are taken."""
    for _ in range(number):
        raw = stack.enter_context(socket.socket(family))
        raw.settimeout(LIMIT_S)
        with suppress(OSError):  # while the port is closed
            raw.connect(address)


@pytest.mark.parametrize("door", ["messages", "publications", "local", "local publications"])
def test_a_flood_without_keys_does_not_end_the_hub(tmp_path, door):
    with guarded_hub(tmp_path, code=_FEW_DESCRIPTORS) as hub, ExitStack() as stack:
        for _ in range(7):
            if door.startswith("local"):
                path = hub.local.removeprefix("ipc://")
                flood(stack, socket.AF_UNIX, path + ".publications" * (door != "local"), 60)
            else:
                port = int(hub.address.rpartition(":")[2]) + (door == "publications")
                flood(stack, socket.AF_INET, ("127.0.0.1", port), 60)
            assert hub.status()
        until(lambda: hub.refused("connections"))
        press_through(hub, "through")  # though the flood holds on to what it opened
        assert hub.process.poll() is None


def test_a_message_without_end_at_the_local_door_is_cut_off(tmp_path):
    with guarded_hub(tmp_path, DENSEFACE_MEMORY_MB="200") as hub, \
            closing(Peer(hub.local)) as peer:
        assert peer.status()
        process = psutil.Process(hub.process.pid)
        for _ in range(1000):
            peer.socket.send(bytes(2**20), zmq.SNDMORE)
        peer.socket.send(b"")
        assert happened(peer, zmq.Event.DISCONNECTED)
        until(lambda: process.memory_info().rss < 200 * 2**20)
        until(lambda: hub.refused("memory"))
        press_through(hub, "after")
