"""What a hub tells whoever sends it something malformed; by a DEALER that is none of our clients.

Without an answer are: a part of more than 32 MiB, with which libzmq ends the connection; who has no
key that is allowed; and what is beyond a sender's few answers a second.
"""

import json
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import count
from random import Random

import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.settings import Settings
from denseface.service.daemons.hub import _EventLoop
from denseface.service.daemons.opening import Opening
from denseface.service.errors import RemoteProtocolError
from denseface.service.hub import Hub
from denseface.service.monitoring import Observer, Rejections
from denseface.service.protocol.wire import MAX_PARTS, decode_from_hub, decode_to_hub
from denseface.service.runtime.wake_pipe import WakePipe
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.security.refusals import Refusals
from denseface.service.settings import ServiceSettings
from denseface.service.storage import InlineWriter, OpeningStore
from denseface.service.transport.listeners import Listeners
from tests.fuzzing.corpus import encoded
from tests.fuzzing.mutate import mutate
from tests.waiting import until

CORPUS = encoded()
REQUEST = {"kind": "press", "version": 2, "request": 7, "capture_id": "a"}


@dataclass
class Door:
    """A hub's door, and a peer before it that only knows ZeroMQ and JSON."""

    listeners: Listeners
    receive: Callable
    peer: zmq.Socket
    number: count

    def say(self, *parts: bytes) -> list[bytes]:
        """Send a message; give what the hub says to it, before it answers the next one."""
        number = next(self.number)
        mark = json.dumps({"kind": "get_status", "version": 2, "request": number}).encode()
        self.peer.send_multipart(parts)
        self.peer.send_multipart([mark])
        answers = []
        while True:
            while not self.peer.poll(0):
                for incoming in self.listeners.receive(1):
                    self.receive(incoming)
            header, *_ = self.peer.recv_multipart()
            if json.loads(header).get("request") == number:
                return answers
            answers.append(header)

    def refused(self, *parts: bytes) -> dict:
        """As `say`, of something that has one answer."""
        (answer,) = self.say(*parts)
        return json.loads(answer)


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    own = ServiceSettings(address=f"ipc://{folder}/hub", data=folder / "data", reserve_mib=0)
    with WakePipe() as wake, OpeningStore(own.data) as store, Observer(lambda: 0) as observer, \
            zmq.Context() as context:
        rejections = Rejections(observer.figures.counters)
        with closing(Listeners(context, own, rejections, [wake])) as listeners:
            link = SupervisorLink()
            before = Opening(listeners, store, rejections, link)
            before._refusals = Refusals(count(1).__next__)  # a second from each to the next
            hub = Hub(until(store.store), own, Settings(), observer.figures, rejections)
            loop = _EventLoop(listeners, hub, rejections, observer, InlineWriter(), link,
                              before.refuse)
            with context.socket(zmq.DEALER) as peer:
                peer.set(zmq.LINGER, 0)
                peer.connect(own.address)
                yield Door(listeners, loop._receive, peer, count(2**40))


def header(**changes) -> bytes:
    return json.dumps({name: value for name, value in (REQUEST | changes).items()
                       if value is not ...}).encode()


@pytest.mark.parametrize(("parts", "number", "words"), [
    ([header(frames=99)], 7, "press.frames: expected at most 32, found 99"),
    ([header(capture_id="../x")], 7, "press.capture_id: expected letters, digits, - and _, "
                                     "at most 64, found '../x'"),
    ([header(colour="red")], 7, "press.colour: no such field, found 'red'"),
    ([header(capture_id=...)], 7, "press.capture_id: Field required"),
    ([header(version=3, new=True)], 7, "version: found 3, expected 2"),
    ([header(version=...)], 7, "press: no version given, expected 2"),
    ([header(kind="fly")], 7, "kind: found 'fly', no such kind of message"),
    ([header(kind=...)], 7, "kind: missing"),
    ([header(kind=["press"])], 7, """kind: found "['press']", no such kind of message"""),
    ([header(kind="face_done")], 7, "kind: found 'face_done', only the hub says that"),
    ([header(request="x")], 0, "press.request: expected a whole number, found 'x'"),
    ([header(request=...)], 0, "press.request: Field required"),
    ([header(), b"more"], 7, "press: 1 arrays follow, 0 announced"),
    ([header()[:-1]], 7, "header: Invalid JSON: EOF while parsing an object at line 1 column 63"),
    ([b'{"kind":"press","version":2,"request":71'], 0,
     "header: Invalid JSON: EOF while parsing an object at line 1 column 40"),
    ([header().replace(b'"a"', b'"\xff"')], 7,
     "header: Invalid JSON: invalid unicode code point at line 1 column 62"),
    ([b"press"], 0, "header: Invalid JSON: expected value at line 1 column 1"),
    ([b"[1]"], 0, "header: expected a JSON object, found an array"),
    ([header(consent={"text_version": "x" * 70_000})], 7,
     "header has 70097 bytes, at most 65536 allowed"),
    ([header(), *[b""] * MAX_PARTS], 7, "18 parts with 64 bytes, at most 17 with "),
    ([header(), *[b""] * 9000], 7, "9001 parts with 64 bytes, at most 17 with "),
    ([b"", header()], 0, "header: empty, as a REQ socket begins: expected a DEALER's"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_what_is_wrong_with_a_request_is_answered(door, parts, number, words):
    answer = door.refused(*parts)
    assert (answer["kind"], answer["request"]) == ("request_failed", number)
    assert answer["message"].startswith(f"refused: {words}")


def test_what_is_wrong_with_what_is_no_request_is_told_too(door):
    (ready,) = [one for one in CORPUS if json.loads(one[0])["kind"] == "worker_ready"]
    said = door.refused(ready[0].replace(b'"credit":1', b'"credit":-1'))
    assert said["kind"] == "denied"
    assert said["message"] == (
        "refused: worker_ready.credit: expected at least 0, found -1")
    result = next(one for one in CORPUS if json.loads(one[0])["kind"] == "result")
    said = door.refused(*result[:-1], result[-1] + b"x")
    assert said["kind"] == "denied"
    assert "dense_sigma has" in said["message"]


@given(st.integers(0, 2**32))
@settings(deadline=None, max_examples=100)
def test_whatever_is_malformed_has_one_answer_that_is_no_longer_than_it(door, seed):
    rng = Random(seed)
    parts = mutate(rng, rng.choice(CORPUS), CORPUS) or [b""]
    why = fault(parts)
    if why is None:  # it is well-formed
        return
    (answer,) = door.say(*parts)
    said = decode_from_hub([answer]).message
    assert said.kind in ("request_failed", "denied")
    assert said.message.startswith(f"refused: {why}"[:100]) or len(parts) > MAX_PARTS
    assert len(answer) <= max(256, sum(map(len, parts))) + 100
    with suppress(ValueError, KeyError, TypeError, RecursionError):
        number = json.loads(parts[0])["request"]
        if type(number) is int and 0 <= number < 2**63 and said.kind == "request_failed":
            # Python's parser takes more for JSON, and longer headers.
            assert said.request == number or (
                said.request == 0 and why.startswith(("header: Invalid JSON", "header has")))


def fault(parts) -> str | None:
    try:
        decode_to_hub(parts)
    except RemoteProtocolError as error:
        return str(error)
    return None


def test_a_sender_gets_few_answers_a_second():
    now = [0.0]
    said = Refusals(lambda: now[0])
    error = RemoteProtocolError("e")
    burst = [said.answer("key", [b"{}"], error) is not None for _ in range(100)]
    assert burst == [True] * 32 + [False] * 68
    assert said.answer("another", [b"{}"], error)
    now[0] = 1.0
    assert sum(said.answer("key", [b"{}"], error) is not None for _ in range(100)) == 4


def test_an_answer_is_no_longer_than_what_it_answers():
    said = Refusals()
    for size in (0, 10, 300, 5000):
        answer = said.answer("key", [b"x" * size], RemoteProtocolError("\u00e9" * 500))
        assert len(answer.message.encode()) <= min(max(256, size), 1000)
