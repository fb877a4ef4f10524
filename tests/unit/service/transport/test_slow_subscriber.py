"""A subscriber that does not keep up loses what it cannot take, and nobody else does."""

import tempfile
from contextlib import ExitStack

import pytest
import zmq

from denseface.service.transport.sockets import open_socket, publish_parts
from tests.waiting import LIMIT_MS

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
    with ExitStack() as stack:
        def one(topic=b"faces", context=None):
            # Like another process. In one context libzmq 4.3.5 aborts where both ends of a
            # half-sent message are closed.
            context = context or stack.enter_context(zmq.Context())
            socket = stack.enter_context(open_socket(context, zmq.SUB, address))
            socket.set(zmq.LINGER, 0)
            socket.subscribe(topic)
            socket.connect(address)
            assert publisher.poll(LIMIT_MS)
            assert publisher.recv() == b"\1" + topic
            return socket

        yield one


def publish(publisher, quick):
    """Publish 200 messages, which one reads at once; give whether a queue was full, for each."""
    full = []
    for number in range(200):
        full.append(not publish_parts(publisher, [b"faces", LARGE, b"%d" % number]))
        assert quick.poll(LIMIT_MS)
        assert quick.recv_multipart()[2] == b"%d" % number
    return full


def test_the_others_get_everything_and_falling_behind_is_counted(publisher, subscribe):
    quick, slow = subscribe(), subscribe()
    full = publish(publisher, quick)
    got = []
    while not got or got[-1] != 999:
        if slow.poll(100):
            got.append(int(slow.recv_multipart()[2]))
        else:  # it has read all there is: it gets again what comes from now on
            publish_parts(publisher, [b"faces", LARGE, b"999"])
    assert got == sorted(got)
    before = full.index(True)
    assert got[:before] == list(range(before))
    # A queue that is full is not looked at again before half of it was taken.
    assert 1 <= full.count(True) <= 1 + len(got) // 8 < 200 - len(got)
    assert False in [publish_parts(publisher, [b"faces", LARGE, b""]) for _ in range(200)]


def test_who_has_caught_up_gets_what_comes_next(publisher, subscribe):
    # With one thread for both ends its queue is full but once.
    quick, slow = (subscribe(context=publisher.context) for _ in range(2))
    full = publish(publisher, quick)
    for number in range(full.index(True)):
        assert slow.poll(LIMIT_MS)
        assert slow.recv_multipart()[2] == b"%d" % number
    assert publish_parts(publisher, [b"faces", LARGE, b"new"])
    assert slow.poll(LIMIT_MS)
    assert slow.recv_multipart()[2] == b"new"


def test_who_listens_to_another_topic_is_not_asked(publisher, subscribe):
    subscribe(b"preview")
    assert all(publish_parts(publisher, [b"faces", LARGE]) for _ in range(200))


def test_nobody_listens_and_nothing_is_lost(publisher):
    assert all(publish_parts(publisher, [b"faces", LARGE]) for _ in range(200))
