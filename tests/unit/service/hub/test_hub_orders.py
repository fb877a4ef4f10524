"""Any order of events: what was accepted ends once, nothing appears that was not pressed.

An operator who purges, retries and drops, the retention, damaged files and a damaged database, a
full disk, a slow one and a hub that is killed between two steps are among the events.
"""

import shutil
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import patch

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from denseface.recon.face import Consent
from denseface.recon.settings import Settings
from denseface.service.hub import Hub, settings_hash
from denseface.service.hub.captures import Captures
from denseface.service.hub.withdrawn import Withdrawn
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Publish
from denseface.service.protocol.states import TRANSITIONS, CaptureState
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FrameMetadata, _erasure, records, writer
from tests.unit.service.clocks import FakeClock
from tests.unit.service.faulty import FaultyStore, KilledError, StepWriter
from tests.unit.service.hub.bench import FACE, FACE_ARRAYS, FRAME, FRAME_ARRAYS

HASH = settings_hash(Settings())
SETTINGS = ServiceSettings(
    address="ipc:///unused", attempts=2, queue=4, reserve_mib=0, retention=3600)
CONSENT = Consent(
    text_version="1", language="en", retention_s=1000, at=datetime(2026, 1, 31, tzinfo=UTC))
_MEMORY = Path("/dev/shm")  # noqa: S108
"""Syncing is not what is tested here."""
ids = st.sampled_from("abcd")
workers = st.sampled_from([b"w1", b"w2"])


class AnyOrder(RuleBasedStateMachine):
    """A hub between a sensor, two workers and a client that all misbehave."""

    @initialize()
    def start(self):
        self.dies_after: str | None = None
        self.killed = False
        self.patches = [
            patch(f"{module.__name__}.{name}", self.last_step(name, getattr(module, name)))
            for module, name in ((records, "write_parts"), (writer, "sync_folder"),
                                 (_erasure, "sync_folder"))]
        for one in self.patches:
            one.start()
        self.folder = Path(tempfile.mkdtemp(dir=_MEMORY if _MEMORY.is_dir() else None))
        self.clock = FakeClock()
        self.store = FaultyStore(self.folder / "data", self.clock)
        self.now = 0.0
        self.credit = 0
        self.request = self.frames = 0
        self.shown: dict[str, str] = {}
        self.pressed, self.taken, self.accepted = set(), set(), set()
        self.jobs: dict[bytes, list[messages.Job]] = {}
        self.published: list[messages.FaceDone | messages.CaptureFailed] = []
        self.states: dict[str, CaptureState] = {}
        note = Captures._note

        def noted(captures, capture_id, state):
            self.takes_a_transition(capture_id, state)
            note(captures, capture_id, state)

        self.patches.append(patch.object(Captures, "_note", noted))
        self.patches[-1].start()
        self.restart()

    def teardown(self):
        if not hasattr(self, "store"):
            return
        try:
            self.dies_after = None
            self.store.full = False
            self.writer.immediate = True
            self.the_disk_goes_on(9)
            self.jobs.clear()  # those workers died; two good ones finish
            self.work()
            self.read_all()  # finds what is damaged
            self.work()
            assert sorted(self.read_all()) == sorted(self.accepted)
            self.ids_are_known()
            self.now += 601  # what resisted is removed later
            self.tick()
            left = {path.name.partition(".")[0] for folder in ("frames", "faces")
                    for path in (self.folder / "data" / folder).iterdir()}
            assert left <= self.accepted
        finally:
            for one in self.patches:
                one.stop()
            self.store.__exit__()
            shutil.rmtree(self.folder)

    def work(self):
        for _ in range(20):
            for worker in (b"w1", b"w2"):
                self.ready(worker)
                while self.jobs.get(worker):
                    self.result(worker)
            self.pass_time(4.0)

    def read_all(self):
        """What a subscriber gets that asks from the start."""
        found, after = [], 0
        while True:
            packet = self.hub.receive(self.now, b"c", Packet(
                messages.GetNext(request=1, after=after)))[0].packet
            if isinstance(packet.message, messages.NothingNewer):
                return found
            assert packet.message.sequence > after
            after = packet.message.sequence
            self.is_of_the_stored_frame(packet.message)
            found.append(packet.message.capture_id)

    def is_of_the_stored_frame(self, outcome):
        if isinstance(outcome, messages.FaceDone):
            assert outcome.face.report.calibration == self.shown[outcome.capture_id]

    def handle(self, outputs):
        for output in outputs:
            message = output.packet.message
            if isinstance(output, Publish):
                if output.topic is Topic.FACES:
                    self.is_of_the_stored_frame(message)
                    self.published.append(message)
            elif isinstance(message, messages.Take):
                self.taken.add(message.capture_id)
            elif isinstance(message, messages.PressAccepted):
                self.accepted.add(message.capture_id)
            elif isinstance(message, messages.Job):
                self.jobs.setdefault(output.peer, []).append(message)

    def answered(self, jobs):
        self.answering = job = jobs.pop()
        return {"capture_id": job.capture_id, "settings_hash": job.settings_hash,
                "frame_sha256": job.frame_sha256}

    def face(self):
        """Says of which frame it was made."""
        report = FACE.report.model_copy(
            update={"calibration": self.answering.frame.calibration_origin})
        return FACE.model_copy(update={"report": report})

    def last_step(self, name, step):
        def done(*arguments, **more):
            result = step(*arguments, **more)
            if self.dies_after == name:
                raise KilledError
            return result
        return done

    def say(self, peer, message, arrays=None):
        try:
            self.handle(self.hub.receive(self.now, peer, Packet(message, arrays or {})))
        except KilledError:
            self.kill()

    def writes(self, pending):
        if isinstance(pending.metadata, FrameMetadata):
            self.shown[pending.capture_id] = pending.packet.message.frame.calibration_origin

    @rule()
    def restart(self):
        """As a hub does that is told to stop, and another."""
        if hasattr(self, "writer"):
            try:
                self.handle(self.hub.written(self.now, wait=True))
            except KilledError:
                self.kill()
                return
        self.start_hub()

    def start_hub(self):
        immediate = self.writer.immediate if hasattr(self, "writer") else True
        self.writer = StepWriter(self.store.room, self.writes)
        self.writer.immediate = immediate
        self.hub = Hub(self.store, SETTINGS, Settings(), writer=self.writer)
        self.states = {capture_id: row.state for capture_id in "abcd"
                       if (row := self.store.find(capture_id))}

    def takes_a_transition(self, capture_id, state):
        """Follow a capture's states by what the hub notes of it."""
        before = self.states.get(capture_id)
        assert state in [after for (known, _), after in TRANSITIONS.items() if known is before]
        if state in (CaptureState.REFUSED, CaptureState.REMOVED):
            del self.states[capture_id]
        else:
            self.states[capture_id] = state

    @rule(immediate=st.booleans())
    def the_disk_becomes(self, immediate):
        """Slow, or as quick as in other tests."""
        self.writer.immediate = immediate

    @rule(count=st.integers(1, 3))
    def the_disk_goes_on(self, count):
        """Files are safe, or gone, and the hub hears of it."""
        self.writer.holds = False
        try:
            self.writer.step(count)
            self.handle(self.hub.written(self.now))
        except KilledError:
            self.kill()

    @rule(seconds=st.sampled_from([0.1, 1.0, 4.0, 11.0]))
    def pass_time(self, seconds):
        self.now += seconds
        self.clock.pass_time(seconds)
        self.tick()

    def tick(self):
        try:
            self.handle(self.hub.tick(self.now))
        except KilledError:
            self.kill()

    @rule()
    def sensor(self):
        self.say(b"s", messages.SensorReady(name="s", source="x"))

    @rule(capture_id=ids, again=st.booleans(), consent=st.sampled_from([None, CONSENT]))
    def press(self, capture_id, again=False, consent=None):
        self.pressed.add(capture_id)
        self.request += not again
        self.say(b"c", messages.Press(
            request=self.request, capture_id=capture_id, consent=consent))

    @rule(capture_id=ids)
    def frame(self, capture_id):
        if capture_id in self.taken:
            self.frames += 1
            frame = FRAME.model_copy(update={"calibration_origin": f"frame {self.frames}"})
            self.say(b"s", messages.Frame(capture_id=capture_id, frame=frame), FRAME_ARRAYS)

    @rule(capture_id=ids, worker=workers)
    def all_goes_well_until_the_job(self, capture_id, worker):
        self.sensor()
        self.press(capture_id)
        self.frame(capture_id)
        self.ready(worker)

    @rule(capture_id=ids)
    def frame_failed(self, capture_id):
        self.say(b"s", messages.FrameFailed(capture_id=capture_id, message="none"))

    @rule(worker=workers)
    def ready(self, worker):
        self.credit += 1
        self.say(worker, messages.WorkerReady(name="w", credit=self.credit))

    @rule(worker=workers, holds_job=st.booleans())
    def heartbeat(self, worker, holds_job):
        held = self.jobs.get(worker) or [None]
        holding = held[-1].capture_id if holds_job and held[-1] else None
        self.say(worker, messages.Heartbeat(holding=holding))

    @rule(worker=workers)
    def result(self, worker):
        if jobs := self.jobs.get(worker):
            self.say(worker, messages.Result(
                **self.answered(jobs), face=self.face()), FACE_ARRAYS)

    @rule(worker=workers, final=st.booleans())
    def failure(self, worker, final):
        if jobs := self.jobs.get(worker):
            self.say(worker, messages.JobFailed(
                **self.answered(jobs), error="E", message="m", final=final))

    @rule(worker=workers, capture_id=ids, success=st.booleans())
    def an_answer_finds_the_disk_full(self, worker, capture_id, success):
        self.all_goes_well_until_the_job(capture_id, worker)
        self.store.full = True
        if success:
            self.result(worker)
        else:
            self.failure(worker, final=True)
        self.store.full = False

    @rule(capture_id=ids, worker=workers)
    def a_late_face_comes_after_a_purge(self, capture_id, worker):
        self.all_goes_well_until_the_job(capture_id, worker)
        self.purge(capture_id)
        self.press(capture_id)
        self.frame(capture_id)
        self.result(worker)

    @rule(capture_id=ids, worker=workers, another=workers)
    def two_faces_come_before_the_first_is_safe(self, capture_id, worker, another):
        self.all_goes_well_until_the_job(capture_id, worker)
        self.writer.immediate = False
        copies = [job for job in self.jobs.get(worker, []) if job.capture_id == capture_id]
        self.jobs.setdefault(another, []).extend(copies)
        self.result(worker)
        self.result(another)

    @rule(worker=workers)
    def job_never_arrives(self, worker):
        self.jobs.pop(worker, None)

    @rule(peer=st.sampled_from([b"s", b"w1", b"w2"]))
    def leaves(self, peer):
        self.say(peer, messages.Goodbye())

    @rule(peer=st.sampled_from([b"s", b"w1", b"w2", b"c"]))
    def unreachable(self, peer):
        self.handle(self.hub.unreachable(peer))

    @rule(peer=st.sampled_from([b"s", b"w1", b"w2", b"c"]), local=st.booleans())
    def its_connection_ends(self, peer, local):
        self.handle(self.hub.connection_ended(peer, local=local))

    @rule(days=st.sampled_from([-400, 400]))
    def set_the_wall_clock(self, days):
        self.clock.set_wall(days * 86400.0)

    @rule()
    def the_retention_passes(self):
        self.the_disk_goes_on(9)  # no disk takes an hour
        for _ in range(2):  # once more, for what was set back
            self.clock.pass_time(3700.0)
            self.now += 3700.0
            for _ in range(3):
                self.tick()
                self.now += 600.0
        left = self.store.unfinished()
        assert all(self.store.consent(one) is None or
                   self.states[one] is CaptureState.SAVING_FACE for one in left)
        self.accepted &= set(left)
        assert not self.store.outcome_after(0)

    def operate(self, message):
        self.killed = False
        return self.answer(message)

    def answer(self, message):
        try:
            outputs = self.hub.receive(self.now, b"o", Packet(message))
            self.writer.erase_all()
            outputs += self.hub.written(self.now)
        except KilledError:
            self.kill()
            return self.answer(message)
        answers = [one.packet.message for one in outputs if getattr(one, "peer", None) == b"o"]
        self.handle(outputs)
        (answer,) = answers
        return answer

    @rule(capture_id=ids)
    def purge(self, capture_id):
        answer = self.operate(messages.Purge(request=1, capture_id=capture_id))
        assert self.killed or answer.removed == (capture_id in self.accepted)
        self.tick()
        self.accepted.discard(capture_id)
        self.taken.discard(capture_id)
        assert not [path for path in (self.folder / "data").rglob("*.f*")
                    if capture_id in path.name.split(".")]

    @rule(capture_id=ids)
    def withdraw(self, capture_id):
        answer = self.operate(messages.Withdraw(request=1, capture_id=capture_id))
        assert self.killed or answer.removed == (capture_id in self.accepted)
        self.tick()
        self.accepted.discard(capture_id)
        self.taken.discard(capture_id)
        assert not [path for path in (self.folder / "data").rglob("*.f*")
                    if capture_id in path.name.split(".")]
        self.hub._presses.withdrawn = Withdrawn()  # as after a restart: there are few ids here

    @rule(capture_id=ids)
    def a_purge_waits_for_the_disk(self, capture_id):
        """What else happens comes before the files are gone."""
        self.writer.holds = True
        self.killed = False
        self.request += 1
        self.say(b"p", messages.Purge(request=self.request, capture_id=capture_id))
        if not self.killed:
            self.accepted.discard(capture_id)
            self.taken.discard(capture_id)

    @rule()
    def purge_all(self):
        answer = self.operate(messages.Purge(request=1, everything=True))
        assert self.killed or (answer.removed, answer.left) == (len(self.accepted), False)
        self.tick()
        self.accepted.clear()
        self.taken.clear()
        assert not [path for folder in ("frames", "faces", "quarantine")
                    for path in (self.folder / "data" / folder).iterdir()]

    @rule(drop=st.booleans())
    def dead_letter(self, drop):
        letters = self.operate(messages.ListDead(request=1)).letters
        for letter in letters:
            assert self.store.find(letter.capture_id).state is CaptureState.DEAD
            if drop:
                answer = self.operate(
                    messages.DropDead(request=1, capture_id=letter.capture_id))
                assert self.killed or answer.removed == 1
                self.accepted.discard(letter.capture_id)
            else:
                self.operate(messages.RetryDead(request=1, capture_id=letter.capture_id))

    @precondition(lambda self: self.accepted)
    @rule(data=st.data(), folder=st.sampled_from(["frames", "faces"]), gone=st.booleans())
    def damage_a_file(self, data, folder, gone):
        files = sorted((self.folder / "data" / folder).iterdir())
        if not files:
            return
        path = data.draw(st.sampled_from(files))
        if gone:
            path.unlink()
            return
        content = bytearray(path.read_bytes())
        content[data.draw(st.integers(0, len(content) - 1))] ^= 1
        path.write_bytes(content)

    @rule(full=st.booleans())
    def disk(self, full):
        self.store.full = full

    @rule(step=st.sampled_from(["write_parts", "sync_folder", None]))
    def arm_crash(self, step):
        self.dies_after = step

    @rule()
    def kill(self):
        self.dies_after = None
        self.killed = True
        self.store.__exit__()
        self.store = FaultyStore(self.folder / "data", self.clock)
        self.start_hub()
        # What was safe and not yet acknowledged may be there.
        self.accepted |= self.rows() & self.taken

    @rule(damage=st.sampled_from(["gone", "empty", "cut", "garbage"]))
    def damage_the_database(self, damage):
        self.restart()
        self.store.__exit__()
        path = self.folder / "data" / "captures.sqlite3"
        content = path.read_bytes()
        match damage:
            case "gone":
                path.unlink()
            case "empty":
                path.write_bytes(b"")
            case "cut":
                path.write_bytes(content[:len(content) * 2 // 3])
            case "garbage":
                path.write_bytes(content[:5000] + b"\xff" * 4000 + content[9000:])
        known = {path.name.partition(".")[0] for folder in ("frames", "faces")
                 for path in (self.folder / "data" / folder).iterdir()}
        self.store = FaultyStore(self.folder / "data", self.clock)
        self.start_hub()
        self.published.clear()  # another epoch
        self.accepted &= known  # a dead letter whose frame is gone is known to the rows alone
        self.ids_are_known()

    def rows(self):
        return {capture_id for capture_id in "abcd" if self.store.find(capture_id)}

    @invariant()
    def ids_are_known(self):
        """What was accepted is there; what is there was accepted."""
        assert self.rows() == self.accepted

    @invariant()
    def states_are_those_that_followed_by_the_table(self):
        """They fit to what the hub has in its hands, and to the rows."""
        presses, jobs = self.hub._presses, self.hub._jobs
        held = {one for worker in self.hub._peers.workers.values() for one in worker.jobs}
        for capture_id in "abcd":
            state = self.states.get(capture_id)
            assert jobs._captures.state(capture_id) is state
            press, row = presses._presses.get(capture_id), self.store.find(capture_id)
            assert (press is not None) == (
                state in (CaptureState.PRESSED, CaptureState.SAVING_FRAME))
            if press:
                assert row is None
                assert (press.frame_sender is not None) == (state is CaptureState.SAVING_FRAME)
            elif row is None or row.state is not CaptureState.ACCEPTED:
                assert state is (row.state if row else None)
            elif capture_id in jobs._unsaved_faces._pending:
                assert state is CaptureState.SAVING_FACE
            elif state is CaptureState.WORKING:
                assert capture_id in held
            else:
                assert state is CaptureState.ACCEPTED
                assert capture_id in held or capture_id in jobs._queue

    @invariant()
    def numbers_only_rise(self):
        numbers = [outcome.sequence for outcome in self.published]
        assert numbers == sorted(set(numbers))
        assert {outcome.capture_id for outcome in self.published} <= self.pressed


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(deadline=None, max_examples=60, stateful_step_count=40)
