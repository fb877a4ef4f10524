"""A subscriber that does not keep up loses what it cannot take, and nobody else does."""

import tempfile

import pytest
import zmq

from service.sockets import open_socket, publish_parts

LARGE = bytes(200_000)


@pytest.fixture
def publisher():
    with tempfile.TemporaryDirectory(prefix="df-") as folder, zmq.Context() as context:
        address = f"ipc://{folder}/x"
        publisher = open_socket(context, zmq.XPUB, address)
        publisher.bind(address)
        publisher.set(zmq.XPUB_VERBOSE, 1)
        yield publisher
        publisher.close(linger=0)


@pytest.fixture
def subscribe(publisher):
    address = publisher.get_string(zmq.LAST_ENDPOINT).rstrip("\0")
    made = []

    def one(topic=b"faces"):
        socket = open_socket(publisher.context, zmq.SUB, address)
        made.append(socket)
        socket.subscribe(topic)
        socket.connect(address)
        assert publisher.poll(5000)
        assert publisher.recv() == b"\1" + topic
        return socket

    yield one
    for socket in made:
        # libzmq 4.3.5 aborts where both ends of a half-sent message are closed in one context.
        while socket.poll(200):
            socket.recv_multipart()
        socket.close(linger=0)


def test_the_others_get_everything_and_falling_behind_is_counted_once(publisher, subscribe):
    quick, slow = subscribe(), subscribe()
    full = []
    for number in range(200):
        full.append(not publish_parts(publisher, [b"faces", LARGE, b"%d" % number]))
        assert quick.poll(5000)
        assert quick.recv_multipart()[2] == b"%d" % number
    assert full.count(True) == 1
    got = 0
    while slow.poll(200):
        slow.recv_multipart()
        got += 1
    assert 16 <= got < 200
    # It reads again, and gets again what comes from now on; it may fall behind again.
    assert publish_parts(publisher, [b"faces", LARGE, b"new"])
    assert slow.poll(5000)
    assert slow.recv_multipart()[2] == b"new"
    assert False in [publish_parts(publisher, [b"faces", LARGE, b""]) for _ in range(200)]


def test_who_listens_to_another_topic_is_not_asked(publisher, subscribe):
    subscribe(b"preview")
    assert all(publish_parts(publisher, [b"faces", LARGE]) for _ in range(200))


def test_nobody_listens_and_nothing_is_lost(publisher):
    assert all(publish_parts(publisher, [b"faces", LARGE]) for _ in range(200))
