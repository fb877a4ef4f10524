"""What is counted of a capture's life, seen from its messages alone."""

import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.monitoring import Figures
from denseface.service.monitoring.message_watch import MessageWatch
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Send, send, steps
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore
from tests.unit.service.faces import small_face
from tests.unit.service.hub.bench import (
    CLIENT,
    FACE_ARRAYS,
    HASH,
    OTHER,
    SENSOR,
    SETTINGS,
    WORKER,
    Bench,
)
from tests.unit.service.hub.bench import FACE as HEADER


class WatchedBench(Bench):
    """As the hub's loop does: what happens is over half a second after it began."""

    def __init__(self, store):
        self.figures = Figures()
        super().__init__(Hub(store, SETTINGS, Settings(), self.figures), store)
        self.watch = MessageWatch(self.figures)

    def say(self, peer, message, arrays=None, key=""):
        packet = Packet(message, arrays or {})
        outputs = self.hub.receive(self.now, peer, packet, key)
        self.now += 0.5
        for step in steps(outputs):
            self.watch.record(self.now, packet, step)
            self.now += 0.25
        self.now -= 0.25
        return self._sent(outputs)

    def wait(self, seconds):
        self.now += seconds
        outputs = self.hub.tick(self.now)
        self.watch.record(self.now, None, outputs)
        return self._sent(outputs)

    def counted(self):
        return {(name, label) if label else name: count
                for name, label, count in self.figures.counters.items() if name != "refused"}

    def times(self):
        return {stage: (one.count, one.total_s)
                for stage, one in self.figures.latencies.stages().items()}


@pytest.fixture
def bench(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield WatchedBench(store)


def test_a_capture_is_counted_once_with_the_time_of_every_stage(bench):
    bench.worker()
    bench.accepted("a")
    bench.frame("a")  # repeats count for nothing
    bench.press("a")
    bench.result("a")
    bench.result("a")
    assert bench.counted() == {"accepted": 1, "done": 1}
    times = bench.times()
    assert times.pop("recon_total") == (1, pytest.approx(
        small_face().report.timings_ms["total"] / 1000))
    assert times == {
        "press_to_accepted": (1, 0.5), "accepted_to_dispatched": (1, 0.25),
        "dispatched_to_result": (1, 1.5), "press_to_published": (1, 2.25)}


def test_what_is_said_before_a_job_has_its_own_time(bench):
    bench.accepted("a", "b")
    outputs = [send(SENSOR, messages.FrameAccepted(capture_id="a"))]
    for credit, capture_id in enumerate("ab"):
        outputs += [one for one in bench.hub.receive(bench.now, WORKER, Packet(
            messages.WorkerReady(name="w", credit=credit))) if isinstance(one, Send)]
        outputs.append(send(CLIENT, messages.PressAccepted(request=1, capture_id=capture_id)))
    assert [[one.packet.message.kind for one in step] for step in steps(outputs)] == [
        ["frame_accepted"], ["job", "press_accepted"], ["job", "press_accepted"]]
    assert [list(step) for step in steps([])] == [[]]


def test_a_job_that_is_given_out_again_and_then_given_up(bench):
    bench.worker()
    bench.accepted("a")
    bench.fail_job()
    bench.worker(credit=1)
    bench.fail_job()
    assert bench.counted() == {"accepted": 1, "redelivered": 1, "dead": 1}
    assert bench.times()["accepted_to_dispatched"][0] == 1
    assert bench.times()["dispatched_to_result"][0] == 2


def test_no_face_is_a_failure(bench):
    bench.worker()
    bench.accepted("a")
    bench.fail_job(final=True)
    assert bench.counted() == {"accepted": 1, "failed": 1}


def test_refused_presses_are_counted_once_by_reason(bench):
    bench.press("early")
    bench.press("early")  # a repeat
    bench.sensor()
    bench.press("late")
    bench.press("late", peer=OTHER)
    for _ in range(11):  # the sensor lives, without a frame
        bench.say(SENSOR, messages.Heartbeat())
        bench.wait(1.0)
    bench.press("broken")
    bench.say(SENSOR, messages.FrameFailed(capture_id="broken", message="why"))
    bench.press("left")
    bench.say(SENSOR, messages.Goodbye())
    assert bench.counted() == {
        ("press_refused", reason): 1 for reason in ("no_sensor", "timeout", "sensor",
                                                    "sensor_gone")}


def test_a_press_for_which_there_is_no_room(bench):
    bench.accepted("a", "b", "c")
    ((_, refused),) = bench.press("d")
    assert refused.reason == "queue"
    assert bench.counted()["press_refused", "queue"] == 1


def test_what_is_fetched_is_no_publication(bench):
    bench.worker()
    bench.accepted("a")
    bench.result("a")
    bench.say(CLIENT, messages.GetNext(request=1, after=0))
    bench.say(CLIENT, messages.GetNext(request=2, after=9999))
    bench.say(CLIENT, messages.GetFace(request=3, capture_id="a"))
    assert bench.counted() == {"accepted": 1, "done": 1, "fetched": 1}


def test_a_worker_s_stage_names_are_limited(bench):
    bench.worker()
    bench.accepted("a")
    report = HEADER.report.model_copy(update={
        "timings_ms": {f"stage{number}": 1.0 for number in range(1000)}})
    bench.say(WORKER, messages.Result(
        capture_id="a", settings_hash=HASH, frame_sha256=bench.checksum("a"),
        face=HEADER.model_copy(update={"report": report})), FACE_ARRAYS)
    assert bench.counted()["done"] == 1
    assert len(bench.times()) < 40


def test_the_times_of_captures_that_never_end_are_let_go_of(bench):
    for number in range(10_100):
        packet = Packet(messages.Take(capture_id=f"c{number}"))
        bench.watch.record(0.0, None, [messages_to(packet)])
    assert len(bench.watch._captures) == 10_000


def messages_to(packet):
    from denseface.service.protocol.outgoing import Send

    return Send(SENSOR, packet)


def test_the_status_says_it_too(bench):
    bench.worker()
    bench.press("early")
    bench.accepted("a")
    bench.result("a")
    bench.figures.kept_bytes = 7
    ((_, status),) = bench.say(CLIENT, messages.GetStatus(request=1))
    assert status.since_start == {"accepted": 1, "done": 1}
    assert status.presses_refused == {"no_sensor": 1}
    assert status.latencies["press_to_published"].count == 1
    assert status.kept_bytes == 7
    assert status.free_bytes > 0
