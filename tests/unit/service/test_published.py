"""Following publications with gaps, repeats and restarts."""

import pytest
import zmq

from service import messages
from service.credentials import connect
from service.errors import ClientTimeoutError
from service.outputs import Topic
from service.published import Subscriber
from service.wire import Packet, encode


class FakeHub:
    """Publishes what it is told to; gives on request all that happened."""

    def __init__(self, context, address):
        self.socket = context.socket(zmq.XPUB)
        self.socket.set(zmq.LINGER, 0)
        self.socket.bind(address)
        self.epoch = "a"
        self.outcomes = []
        self.asked = []

    def subscribed(self):
        for _ in (Topic.FACES, Topic.STATUS):
            assert self.socket.poll(5000)
            self.socket.recv_multipart()

    def conclude(self, *, published=True):
        sequence = len(self.outcomes) + 1
        message = messages.CaptureFailed(
            epoch=self.epoch, sequence=sequence, capture_id=f"{self.epoch}{sequence}", error="E",
            message="m", dead=False)
        self.outcomes.append(message)
        if published:
            self.publish(Topic.FACES, message)

    def publish(self, topic, message):
        self.socket.send_multipart([topic.encode(), *encode(Packet(message))])

    def status(self, *, timeout=5.0):  # noqa: ARG002
        return messages.Status(
            epoch=self.epoch, sequence=len(self.outcomes), hub_version="0", sensors=(),
            workers=(), pressed=0, queued=0, working=0, done=0, failed=0, dead=0)

    def next(self, after, timeout):  # noqa: ARG002
        self.asked.append(after)
        if after < len(self.outcomes):
            return Packet(self.outcomes[after])
        return Packet(messages.NothingNewer(epoch=self.epoch, sequence=len(self.outcomes)))


@pytest.fixture
def hub():
    context = zmq.Context()
    hub = FakeHub(context, "inproc://published")
    yield hub
    hub.socket.close()
    context.term()


@pytest.fixture
def follow(hub):
    socket, knock = connect(hub.socket.context, zmq.SUB, "inproc://published", None)
    with Subscriber(socket, knock, hub.next, hub.status) as follow:
        hub.subscribed()
        follow.start(None, 5)
        with pytest.raises(ClientTimeoutError):
            follow.next(0.01)
        hub.asked.clear()
        yield follow


def ids(follow, count):
    return [follow.next(5).capture_id for _ in range(count)]


def test_what_is_published_is_not_asked_for(hub, follow):
    hub.conclude()
    hub.conclude()
    assert ids(follow, 2) == ["a1", "a2"]
    assert hub.asked == []


def test_a_gap_is_filled(hub, follow):
    hub.conclude(published=False)
    hub.conclude(published=False)
    hub.conclude()
    hub.conclude()
    assert ids(follow, 4) == ["a1", "a2", "a3", "a4"]


def test_a_repeated_publication_is_seen_once(hub, follow):
    hub.conclude()
    hub.publish(Topic.FACES, hub.outcomes[0])
    hub.conclude()
    assert ids(follow, 2) == ["a1", "a2"]


def test_the_last_one_missed_is_known_from_the_status(hub, follow):
    hub.conclude(published=False)
    hub.publish(Topic.STATUS, hub.status())
    assert ids(follow, 1) == ["a1"]


def test_another_store_starts_over(hub, follow):
    hub.conclude()
    assert ids(follow, 1) == ["a1"]
    hub.epoch, hub.outcomes = "b", []
    hub.conclude(published=False)
    hub.conclude()
    assert ids(follow, 2) == ["b1", "b2"]


def test_garbage_is_taken_for_something_missed(hub, follow):
    hub.conclude(published=False)
    hub.socket.send_multipart([b"faces", b"garbage"])
    assert ids(follow, 1) == ["a1"]


def test_a_start_in_the_past_gives_all_since(hub):
    for _ in range(3):
        hub.conclude(published=False)
    socket, knock = connect(hub.socket.context, zmq.SUB, "inproc://published", None)
    with Subscriber(socket, knock, hub.next, hub.status) as follow:
        hub.subscribed()
        follow.start(1, 5)
        assert ids(follow, 2) == ["a2", "a3"]


def test_numbers_that_were_removed_are_not_waited_for(hub, follow):
    for _ in range(3):
        hub.conclude(published=False)
    follow._ask_next = lambda after, _: hub.asked.append(after) or Packet(
        messages.NothingNewer(epoch=hub.epoch, sequence=3))
    hub.publish(Topic.STATUS, hub.status())
    hub.publish(Topic.STATUS, hub.status())
    hub.conclude()
    assert ids(follow, 1) == ["a4"]
    assert hub.asked == [0]

def test_a_start_is_asked_for(hub):
    hub.conclude(published=False)
    hub.conclude(published=False)
    socket, knock = connect(hub.socket.context, zmq.SUB, "inproc://published", None)
    with Subscriber(socket, knock, hub.next, hub.status) as follow:
        hub.subscribed()
        follow.start(None, 5, lambda _: messages.StartAt(epoch=hub.epoch, sequence=1))
        assert ids(follow, 1) == ["a2"]


def test_a_hub_that_is_away_is_waited_for(hub, follow):
    answers = iter([ClientTimeoutError("away"), ClientTimeoutError("away")])
    real = hub.next

    def flaky(after, timeout):
        for error in answers:
            raise error
        return real(after, timeout)

    follow._ask_next = flaky
    hub.conclude(published=False)
    hub.publish(Topic.STATUS, hub.status())
    assert ids(follow, 1) == ["a1"]
