"""Following publications with gaps, repeats and restarts: without a socket."""

from collections import deque

import pytest

from denseface.service.client.exchanges import AwaitPublication, Exchanges, SendRequest
from denseface.service.client.follower import Follower
from denseface.service.errors import ClientTimeoutError, LocalProtocolError
from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet


class FakeHub:
    """Publishes what it is told to; gives on request all that happened."""

    def __init__(self):
        self.epoch = "a"
        self.outcomes = []
        self.published = deque()
        self.asked = []
        self.away = 0
        self.opening = 0
        """Times that it says that it is not yet serving."""

    def conclude(self, *, published=True):
        sequence = len(self.outcomes) + 1
        message = messages.CaptureFailed(
            epoch=self.epoch, sequence=sequence, capture_id=f"{self.epoch}{sequence}", error="E",
            message="m", dead=False)
        self.outcomes.append(message)
        if published:
            self.publish(message)

    def publish(self, message):
        self.published.append(Packet(message))

    def status(self):
        return messages.Status(
            epoch=self.epoch, sequence=len(self.outcomes), hub_version="0", sensors=(),
            workers=(), pressed=0, queued=0, working=0, done=0, failed=0, dead=0)

    def next(self, after):
        self.asked.append(after)
        if after < len(self.outcomes):
            return self.outcomes[after]
        return messages.NothingNewer(epoch=self.epoch, sequence=len(self.outcomes))

    def do(self, step):
        match step:
            case AwaitPublication():
                if not self.published:
                    raise ClientTimeoutError("silence")
                return self.published.popleft()
            case SendRequest() if self.away:
                self.away -= 1
                raise ClientTimeoutError("away")
            case SendRequest(message=messages.GetStatus()) if self.opening:
                self.opening -= 1
                return Packet(self.status().model_copy(
                    update={"epoch": "0", "sequence": 0, "state": "opening"}))
            case SendRequest(message=messages.GetStatus()):
                return Packet(self.status())
            case SendRequest(message=messages.GetNext(after=after)):
                return Packet(self.next(after))
            case SendRequest(message=messages.FindStart(last=last)):
                return Packet(messages.StartAt(
                    epoch=self.epoch, sequence=len(self.outcomes) - last))

    def run(self, exchange):
        try:
            step = next(exchange)
            while True:
                try:
                    came = self.do(step)
                except ClientTimeoutError as error:
                    step = exchange.throw(error)
                else:
                    step = exchange.send(came)
        except StopIteration as end:
            return end.value


@pytest.fixture
def hub():
    return FakeHub()


def following(hub, **start):
    follower = Follower(Exchanges(2.0), **start)
    hub.run(follower.start(60))
    return follower


@pytest.fixture
def follower(hub):
    follower = following(hub)
    with pytest.raises(ClientTimeoutError):
        hub.run(follower.next(60))
    hub.asked.clear()
    return follower


def ids(hub, follower, count):
    return [hub.run(follower.next(60)).capture_id for _ in range(count)]


def test_what_is_published_is_not_asked_for(hub, follower):
    hub.conclude()
    hub.conclude()
    assert ids(hub, follower, 2) == ["a1", "a2"]
    assert hub.asked == []


def test_a_gap_is_filled(hub, follower):
    hub.conclude(published=False)
    hub.conclude(published=False)
    hub.conclude()
    hub.conclude()
    assert ids(hub, follower, 4) == ["a1", "a2", "a3", "a4"]


def test_a_repeated_publication_is_seen_once(hub, follower):
    hub.conclude()
    hub.publish(hub.outcomes[0])
    hub.conclude()
    assert ids(hub, follower, 2) == ["a1", "a2"]


def test_the_last_one_missed_is_known_from_the_status(hub, follower):
    hub.conclude(published=False)
    hub.publish(hub.status())
    assert ids(hub, follower, 1) == ["a1"]


@pytest.mark.parametrize("start", [{"after": 2}, {}])
def test_a_hub_that_is_not_yet_serving_has_no_epoch_to_start_from(hub, start):
    for _ in range(2):
        hub.conclude(published=False)
    hub.opening = 3
    follower = following(hub, **start)
    assert hub.opening == 0
    with pytest.raises(ClientTimeoutError):
        hub.run(follower.next(60))
    assert hub.asked == [2]


def test_a_hub_that_does_not_serve_in_time_is_said(hub):
    hub.opening = 10**9
    with pytest.raises(ClientTimeoutError, match="not yet read its data folder"):
        hub.run(Follower(Exchanges(2.0)).start(0.01))


def test_another_store_starts_over(hub, follower):
    hub.conclude()
    assert ids(hub, follower, 1) == ["a1"]
    hub.epoch, hub.outcomes = "b", []
    hub.conclude(published=False)
    hub.conclude()
    assert ids(hub, follower, 2) == ["b1", "b2"]


def test_garbage_is_taken_for_something_missed(hub, follower):
    hub.conclude(published=False)
    hub.published.append(None)
    assert ids(hub, follower, 1) == ["a1"]


def test_a_start_in_the_past_gives_all_since(hub):
    for _ in range(3):
        hub.conclude(published=False)
    assert ids(hub, following(hub, after=1), 2) == ["a2", "a3"]


def test_numbers_that_were_removed_are_not_waited_for(hub, follower, monkeypatch):
    for _ in range(3):
        hub.conclude(published=False)
    monkeypatch.setattr(hub, "next", lambda after: hub.asked.append(after) or
                        messages.NothingNewer(epoch=hub.epoch, sequence=3))
    hub.publish(hub.status())
    hub.publish(hub.status())
    hub.conclude()
    assert ids(hub, follower, 1) == ["a4"]
    assert hub.asked == [0]


def test_a_start_is_asked_for(hub):
    for _ in range(2):
        hub.conclude(published=False)
    assert ids(hub, following(hub, last=1), 1) == ["a2"]


def test_a_hub_that_is_away_is_waited_for(hub, follower):
    hub.away = 2
    hub.conclude(published=False)
    hub.publish(hub.status())
    assert ids(hub, follower, 1) == ["a1"]


def test_but_no_longer_than_allowed(hub, follower):
    hub.away = 10**9
    hub.conclude(published=False)
    hub.publish(hub.status())
    with pytest.raises(ClientTimeoutError, match="away"):
        hub.run(follower.next(0.0))


@pytest.mark.parametrize("start", [{"after": 1, "last": 1}, {"last": 0}])
def test_impossible_starts_are_refused(start):
    with pytest.raises(LocalProtocolError):
        Follower(Exchanges(2.0), **start)
