"""Whatever messages come from whomever: the hub never raises, and loses nothing it accepted.

Besides what `test_hub_orders` tries: messages of every kind with wrong fields, replays by others,
strangers, peers that are sensor and worker at once, and crowds. Each passes the decoder first, and
all that the hub says must be fit to be written; after each, so must be its status and its metrics.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pytest
from prometheus_client import generate_latest

from denseface.recon.settings import Settings
from denseface.service.errors import ProtocolError
from denseface.service.hub import Hub
from denseface.service.hub.peers import MAX_PEERS
from denseface.service.monitoring import Figures
from denseface.service.monitoring.message_watch import MessageWatch
from denseface.service.monitoring.observer import Snapshot
from denseface.service.monitoring.prometheus import Metrics
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish, steps
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, decode_from_hub, decode_to_hub, encode
from denseface.service.security.permissions import ROLES_BY_KIND
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore
from tests.fuzzing.corpus import Parts, encoded
from tests.fuzzing.mutate import mutate
from tests.unit.service.faulty import StepWriter
from tests.unit.service.hub.bench import FACE, FACE_ARRAYS, FRAME, FRAME_ARRAYS

SETTINGS = ServiceSettings(address="ipc:///unused", attempts=2, queue=6, reserve_mib=0)
_MEMORY = Path("/dev/shm")  # noqa: S108
"""Syncing is not what is tested here."""
IDS = ("a", "b", "c", "d")
PEERS = tuple(b"p%d" % number for number in range(6))
KEYS = ("", "", "c0ffee")
OPERATOR = {messages.Withdraw, messages.Purge, messages.DropDead, messages.RetryDead}
CORPUS = [parts for parts in encoded() if json.loads(parts[0])["kind"] in ROLES_BY_KIND]


@pytest.fixture
def store() -> Iterator[FolderStore]:
    with (TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder,
          FolderStore(Path(folder) / "data") as store):
        yield store


@dataclass
class Hostile:
    """A hub among enemies, and what it promised."""

    store: FolderStore
    rng: Random
    now: float = 0.0
    accepted: set[str] = field(default_factory=set)
    jobs: list[messages.Job] = field(default_factory=list)
    heard: list[Parts] = field(default_factory=list)
    taken: int = 0

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        self.writer = StepWriter(lambda: None, lambda _: None)
        self.figures = Figures()
        self.watch = MessageWatch(self.figures)
        self.hub = Hub(self.store, SETTINGS, Settings(), self.figures, writer=self.writer)
        self.metrics = Metrics(self.snapshot).registry

    def snapshot(self) -> Snapshot:
        """What is shown of the hub, as it would be read from a message."""
        answer, *_ = self.hub.receive(self.now, b"looks", Packet(messages.GetStatus(request=1)))
        status = decode_from_hub(encode(answer.packet)).message
        assert isinstance(status, messages.Status), status
        return Snapshot(self.now, status, tuple(self.figures.counters.items()),
                        self.figures.latencies.stages())

    def handle(self, outputs: list[Output], caused_by: Packet | None = None) -> None:
        for step in steps(outputs):
            self.watch.record(self.now, caused_by, step)
            caused_by = None
        for output in outputs:
            message = decode_from_hub(encode(output.packet)).message
            match message:
                case messages.PressAccepted() | messages.FrameAccepted():
                    self.accepted.add(message.capture_id)
                case messages.Job():
                    self.jobs = [*self.jobs[-20:], message]
            if isinstance(output, Publish) and output.topic is Topic.FACES:
                assert message.capture_id in self.accepted

    def say(self, peer: bytes, parts: Parts) -> None:
        try:
            packet = decode_to_hub(parts)
        except ProtocolError:
            return
        self.taken += 1
        self.heard = [*self.heard[-50:], parts]
        self.handle(self.hub.receive(self.now, peer, packet, self.rng.choice(KEYS)), packet)
        assert generate_latest(self.metrics)
        kept = {one for one in self.accepted if self.store.find(one)}
        if type(packet.message) in OPERATOR:
            self.accepted = kept
        assert self.accepted == kept, packet.message

    def step(self) -> None:
        peer = self.rng.choice(PEERS)
        match self.rng.randrange(10):
            case 0 if self.rng.random() < 0.5:
                self.writer.immediate = not self.writer.immediate
                self.writer.step(self.rng.randrange(4))
                self.handle(self.hub.written(self.now))
            case 0:
                self.now += self.rng.choice((0.1, 1.0, 4.0, 11.0))
                self.handle(self.hub.tick(self.now))
            case 1:
                self.handle(self.hub.unreachable(peer))
            case 2 | 3 if self.heard:
                self.say(peer, self.rng.choice(self.heard))
            case 4 | 5:
                self.say(peer, mutate(self.rng, [bytes(one) for one in self.likely()], CORPUS))
            case 6:
                self.all_is_well_until_the_job(self.rng.choice(IDS))
            case _:
                self.say(peer, self.likely())

    def all_is_well_until_the_job(self, capture_id: str) -> None:
        """Make sure that there is something to lose."""
        for message, arrays in (
                (messages.SensorReady(name="s", source="x"), {}),
                (messages.Press(request=1, capture_id=capture_id), {}),
                (messages.Frame(capture_id=capture_id, frame=FRAME), FRAME_ARRAYS)):
            self.say(PEERS[0], encode(Packet(message, arrays)))

    def likely(self) -> Parts:
        """Give a message that may mean something now."""
        rng, capture_id = self.rng, self.rng.choice(IDS)
        job = rng.choice(self.jobs) if self.jobs else None
        match rng.randrange(9):
            case 0 | 1:
                message, arrays = messages.Press(request=1, capture_id=capture_id), {}
            case 2 | 3:
                message, arrays = messages.Frame(
                    capture_id=capture_id, frame=FRAME), FRAME_ARRAYS
            case 4:
                message, arrays = messages.WorkerReady(name="w", credit=rng.randrange(99)), {}
            case 5:
                message, arrays = messages.SensorReady(name="s", source="x"), {}
            case 6 if job:
                message, arrays = messages.Result(
                    capture_id=job.capture_id, settings_hash=job.settings_hash,
                    frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS
            case 7 if job:
                message, arrays = messages.JobFailed(
                    capture_id=job.capture_id, settings_hash=job.settings_hash,
                    frame_sha256=job.frame_sha256, error="E", message="m",
                    final=rng.random() < 0.3), {}
            case _:
                header, *rest = rng.choice(CORPUS)
                tree = json.loads(header)
                if "capture_id" in tree:
                    tree["capture_id"] = capture_id
                return [json.dumps(tree).encode(), *rest]
        return encode(Packet(message, arrays))

    def conclude(self) -> set[str]:
        """Let an honest worker finish what is left; give the ids that have an outcome."""
        self.handle(self.hub.written(self.now, wait=True))
        self.start()
        self.jobs = []
        for credit in range(20):
            self.say(b"honest", encode(Packet(messages.WorkerReady(name="w", credit=credit))))
            for job in self.jobs:
                self.say(b"honest", encode(Packet(messages.Result(
                    capture_id=job.capture_id, settings_hash=job.settings_hash,
                    frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS)))
            self.jobs = []
        return {one for one in self.accepted if self.store.outcome(one)}


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_raised_and_nothing_accepted_is_lost(store, seed):
    enemies = Hostile(store, Random(seed))
    seen: set[str] = set()
    for _ in range(600):
        enemies.step()
        seen |= enemies.accepted
    assert enemies.taken > 300
    assert seen  # else nothing was tested
    assert enemies.conclude() >= enemies.accepted


def test_every_kind_to_the_hub_is_tried():
    assert {json.loads(parts[0])["kind"] for parts in CORPUS} == {
        kind.model_fields["kind"].default for kind in messages.TO_HUB}


@pytest.mark.parametrize("kind", [messages.SensorReady, messages.WorkerReady])
def test_peers_beyond_the_limit_are_not_taken_and_the_status_can_be_written(store, kind):
    hub = Hub(store, SETTINGS, Settings())
    more = {"source": "x"} if kind is messages.SensorReady else {"credit": 0}
    for number in range(MAX_PEERS + 50):
        hub.receive(0.0, b"%d" % number, Packet(kind(name="\\" * 100, **more)))
        hub.receive(0.0, b"%d" % number, Packet(kind(name="\\" * 100, **more)))
    assert len(hub.peers()) == MAX_PEERS
    other = (messages.WorkerReady(name="\\" * 100, credit=0)
             if kind is messages.SensorReady
             else messages.SensorReady(name="\\" * 100, source="x"))
    for number in range(MAX_PEERS):
        hub.receive(0.0, b"%d" % number, Packet(other))
    for output in hub.tick(1.0):
        decode_from_hub(encode(output.packet))


@pytest.mark.parametrize("kind", ["find_start", "purge"])
@pytest.mark.parametrize("moment", ["0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59"])
def test_a_time_that_does_not_exist_in_utc_is_refused_by_the_decoder(kind, moment):
    name = {"find_start": "since", "purge": "before"}[kind]
    with pytest.raises(ProtocolError, match="does not exist in UTC"):
        decode_to_hub([json.dumps(
            {"kind": kind, "version": 2, "request": 1, name: moment}).encode()])
