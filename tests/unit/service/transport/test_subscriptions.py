"""What subscribers may say, and whom it changes: raw ones against a listener in this process."""

import tempfile
import time
from pathlib import Path

import pytest
import zmq

from denseface.service.monitoring import Counters, Rejections
from denseface.service.protocol.topics import Topic
from denseface.service.transport._subscribers import _MAX_PER_KEY, _MAX_UNKNOWN, Subscribers
from denseface.service.transport.listener import Listener
from tests.waiting import LIMIT_MS, LIMIT_S
from tests.zmtp import RawSubscriber


@pytest.fixture
def rejections():
    return Rejections(Counters())


@pytest.fixture
def listener(rejections):
    with tempfile.TemporaryDirectory(prefix="df-") as folder, zmq.Context() as context:
        one = Listener(context, f"ipc://{folder}/hub", None, rejections)
        yield one
        one.close()


@pytest.fixture
def connect(listener):
    """Connect raw subscribers."""
    path = Path(listener.address.removeprefix("ipc://") + ".publications")
    made = []

    def connect():
        made.append(RawSubscriber(path, LIMIT_S))
        return made[-1]

    yield connect
    for one in made:
        one.close()


@pytest.fixture
def until(listener):
    """Let the listener read until something is true."""
    def until(true):
        deadline = time.monotonic() + LIMIT_S
        while not true():
            assert time.monotonic() < deadline
            zmq.select(listener.sockets, [], [], 0.01)
            listener.read_events()

    return until


@pytest.fixture
def previews(listener):
    return lambda: listener.subscriptions(Topic.PREVIEW)


def test_a_topic_named_three_times_ends_once(connect, until, previews):
    greedy, other = connect(), connect()
    for _ in range(3):
        greedy.send(b"\1preview")
    other.send(b"\1preview")
    until(lambda: previews() == 2)
    greedy.close()
    until(lambda: previews() == 1)
    other.close()
    until(lambda: previews() == 0)


def test_who_never_subscribed_ends_nobody_s_subscription(listener, connect, until, previews):
    watcher, foe = connect(), connect()
    watcher.send(b"\1preview")
    until(lambda: previews() == 1)
    foe.send(b"\0preview")
    foe.send(b"\0preview")
    foe.send(b"\1status")
    until(lambda: listener.subscriptions(Topic.STATUS) == 1)
    assert previews() == 1
    assert listener.publish(Topic.PREVIEW, [b"picture"])
    assert watcher.socket.recv(100).endswith(b"picture")


def test_who_subscribes_after_the_end_of_its_connection_does_not(
        listener, connect, until, previews):
    hasty, last = connect(), connect()
    hasty.send(b"\1preview")
    hasty.close()
    last.send(b"\1status")
    until(lambda: listener.subscriptions(Topic.STATUS) == 1)
    until(lambda: previews() == 0)


def test_too_many_unknown_topics_end_the_connection(connect, until, rejections):
    foe = connect()
    for number in range(_MAX_UNKNOWN + 10):
        foe.send(b"\1topic %d" % number)
    until(lambda: rejections.counts().get("subscriptions"))
    assert foe.ended()
    assert rejections.counts() == {"malformed": _MAX_UNKNOWN, "subscriptions": 1}


def test_a_key_may_have_so_many_subscribed_connections():
    subscribers = Subscribers()
    for descriptor in range(_MAX_PER_KEY + 2):
        subscribers.opened(descriptor)
    for descriptor in range(_MAX_PER_KEY):
        for topic in Topic:
            assert subscribers.subscribe(descriptor, b"key", topic)
    assert not subscribers.subscribe(_MAX_PER_KEY, b"key", Topic.FACES)
    assert subscribers.subscribe(_MAX_PER_KEY, b"other key", Topic.FACES)
    subscribers.closed(0)
    assert subscribers.subscribe(_MAX_PER_KEY + 1, b"key", Topic.FACES)
    assert subscribers.count(Topic.FACES) == _MAX_PER_KEY + 1
    assert subscribers.tokens() == {b"key", b"other key"}


def test_who_needs_no_key_may_have_more():
    subscribers = Subscribers()
    for descriptor in range(2 * _MAX_PER_KEY):
        subscribers.opened(descriptor)
        assert subscribers.subscribe(descriptor, b"", Topic.FACES)


@pytest.mark.parametrize("frames", [
    [(b"nonsense", False)], [(b"", False)], [(b"two ", True), (b"\1parts", False)]])
def test_nonsense_takes_nobody_s_subscription(listener, connect, until, rejections, frames):
    """What follows a message that is no subscription, libzmq takes for another connection's."""
    foe, victims = connect(), [connect() for _ in Topic]
    names = [topic.encode() for topic in Topic]
    for frame, more in frames:
        foe.send(frame, more=more)
    for victim, name in zip(victims, names, strict=True):
        victim.send(b"\1" + name)
    assert zmq.select(listener.sockets[1:2], [], [], LIMIT_S)[0]
    until(lambda: rejections.counts() == {"malformed": 1})
    assert foe.ended()
    # Each victim has its own topic, or was hung up on and connects again as libzmq would.
    for victim, name in zip(victims, names, strict=True):
        def served(victim=victim, name=name):
            listener.publish(Topic(name.decode()), [b"news of " + name])
            victim.socket.settimeout(0.05)
            try:
                data = victim.socket.recv(1000)
            except TimeoutError:
                return False
            except ConnectionResetError:
                return True
            return not data or b"news of " + name in data

        until(served)


def test_a_subscription_reaches_libzmq_s_own_clients(listener, until, previews):
    with zmq.Context() as context, context.socket(zmq.SUB) as sub:
        sub.subscribe("preview")
        sub.connect(listener.address + ".publications")
        until(lambda: previews() == 1)
        assert listener.publish(Topic.PREVIEW, [b"picture"])
        assert sub.poll(LIMIT_MS)
        sub.unsubscribe("preview")
        until(lambda: previews() == 0)
