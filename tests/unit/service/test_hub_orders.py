"""Any order of events: what was accepted ends once, nothing appears that was not pressed."""

import shutil
import tempfile
from pathlib import Path

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from recon.settings import Settings
from service import messages
from service.hub import Hub, settings_hash
from service.outputs import Publish, Topic
from service.settings import ServiceSettings
from service.store import FolderStore
from service.wire import Packet
from tests.unit.service.test_hub import FACE, FACE_ARRAYS, FRAME, FRAME_ARRAYS

HASH = settings_hash(Settings())
SETTINGS = ServiceSettings(address="ipc:///unused", attempts=2, queue=4)
ids = st.sampled_from("abcd")
workers = st.sampled_from([b"w1", b"w2"])


class AnyOrder(RuleBasedStateMachine):
    """A hub between a sensor, two workers and a client that all misbehave."""

    @initialize()
    def start(self):
        self.folder = Path(tempfile.mkdtemp())
        self.store = FolderStore(self.folder / "data")
        self.now = 0.0
        self.credit = 0
        self.pressed, self.taken, self.accepted = set(), set(), set()
        self.jobs: dict[bytes, list[str]] = {}
        self.published: list[messages.FaceDone | messages.CaptureFailed] = []
        self.restart()

    def teardown(self):
        if not hasattr(self, "store"):
            return
        try:
            self.jobs.clear()  # those workers died; two good ones finish
            for _ in range(20):
                for worker in (b"w1", b"w2"):
                    self.ready(worker)
                    while self.jobs.get(worker):
                        self.result(worker)
                self.pass_time(4.0)
            assert {outcome.capture_id for outcome in self.published} >= self.accepted
            self.nothing_twice()
        finally:
            self.store.__exit__()
            shutil.rmtree(self.folder)

    def give(self, outputs):
        for output in outputs:
            message = output.packet.message
            if isinstance(output, Publish):
                if output.topic is Topic.FACES:
                    self.published.append(message)
            elif isinstance(message, messages.Take):
                self.taken.add(message.capture_id)
            elif isinstance(message, messages.PressAccepted):
                self.accepted.add(message.capture_id)
            elif isinstance(message, messages.Job):
                self.jobs.setdefault(output.peer, []).append(message.capture_id)

    def say(self, peer, message, arrays=None):
        self.give(self.hub.receive(self.now, peer, Packet(message, arrays or {})))

    @rule()
    def restart(self):
        self.hub = Hub(self.store, SETTINGS, Settings())

    @rule(seconds=st.sampled_from([0.1, 1.0, 4.0, 11.0]))
    def pass_time(self, seconds):
        self.now += seconds
        self.give(self.hub.tick(self.now))

    @rule()
    def sensor(self):
        self.say(b"s", messages.SensorReady(name="s", source="x"))

    @rule(capture_id=ids)
    def press(self, capture_id):
        self.pressed.add(capture_id)
        self.say(b"c", messages.Press(request=1, capture_id=capture_id))

    @rule(capture_id=ids)
    def frame(self, capture_id):
        if capture_id in self.taken:
            self.say(b"s", messages.Frame(capture_id=capture_id, frame=FRAME), FRAME_ARRAYS)

    @rule(capture_id=ids, worker=workers)
    def all_goes_well_until_the_job(self, capture_id, worker):
        self.sensor()
        self.press(capture_id)
        self.frame(capture_id)
        self.ready(worker)

    @rule(capture_id=ids)
    def no_frame(self, capture_id):
        self.say(b"s", messages.FrameFailed(capture_id=capture_id, message="none"))

    @rule(worker=workers)
    def ready(self, worker):
        self.credit += 1
        self.say(worker, messages.WorkerReady(name="w", credit=self.credit))

    @rule(worker=workers, truly=st.booleans())
    def heartbeat(self, worker, truly):
        held = self.jobs.get(worker) or [None]
        self.say(worker, messages.Heartbeat(holding=held[-1] if truly else None))

    @rule(worker=workers)
    def result(self, worker):
        if jobs := self.jobs.get(worker):
            self.say(worker, messages.Result(
                capture_id=jobs.pop(), settings_hash=HASH, face=FACE), FACE_ARRAYS)

    @rule(worker=workers, final=st.booleans())
    def failure(self, worker, final):
        if jobs := self.jobs.get(worker):
            self.say(worker, messages.JobFailed(
                capture_id=jobs.pop(), settings_hash=HASH, error="E", message="m", final=final))

    @rule(worker=workers)
    def job_never_arrives(self, worker):
        self.jobs.pop(worker, None)

    @rule(peer=st.sampled_from([b"s", b"w1", b"w2"]))
    def leaves(self, peer):
        self.say(peer, messages.Goodbye())

    @rule(peer=st.sampled_from([b"s", b"w1", b"w2", b"c"]))
    def unreachable(self, peer):
        self.give(self.hub.unreachable(peer))

    @invariant()
    def nothing_twice(self):
        names = [outcome.capture_id for outcome in self.published]
        assert len(names) == len(set(names))
        assert [outcome.sequence for outcome in self.published] == list(
            range(1, len(names) + 1))
        assert set(names) <= self.pressed


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(deadline=None, max_examples=40, stateful_step_count=40)
