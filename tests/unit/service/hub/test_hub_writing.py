"""What the hub says while frames and faces are being written, and after."""

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import DiskFullError, StoreError
from denseface.service.hub import Hub
from denseface.service.hub.presses import _MAX_SAVING
from denseface.service.hub.unsaved_faces import _MAX_UNSAVED
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from tests.unit.service.faulty import StepWriter
from tests.unit.service.hub.bench import CLIENT, OTHER, SENSOR, SETTINGS, WORKER, Bench, kinds

IDS = [f"c{number}" for number in range(40)]


class SlowBench(Bench):
    """On a disk that writes when it is told to."""

    full = False

    def room(self):
        if self.full:
            raise DiskFullError("no room on the disk")

    def written(self, count: int = 99):
        self.writer.step(count)
        return self._sent(self.hub.written(self.now))

    def operate(self, message):
        return [one for peer, one in self.say(b"o", message) if peer == b"o"]


@pytest.fixture
def bench(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        bench = SlowBench(None, store)
        bench.writer = StepWriter(bench.room, lambda _: None)
        bench.writer.immediate = False
        bench.hub = Hub(store, SETTINGS.model_copy(update={"queue": 100}), Settings(),
                        writer=bench.writer)
        bench.sensor()
        yield bench


def face_comes(bench, capture_id="a"):
    bench.worker()
    bench.press(capture_id)
    bench.frame(capture_id)
    assert (WORKER, "job") in kinds(bench.written())
    bench.result(capture_id)


def test_nothing_is_accepted_before_it_is_written(bench):
    bench.worker()
    bench.press()
    assert bench.frame() == []
    assert bench.store.find("a") is None
    assert kinds(bench.written()) == [
        (SENSOR, "frame_accepted"), (CLIENT, "press_accepted"), (WORKER, "job")]


def test_a_repeat_while_it_is_written_is_answered_when_it_is_safe(bench):
    bench.press(request=1)
    bench.frame()
    assert bench.press(request=2) == []
    assert bench.press(request=3, peer=OTHER) == []
    assert bench.frame() == []
    assert len(bench.writer.waiting) == 1
    assert [(peer, one.kind, getattr(one, "request", 0)) for peer, one in bench.written()] == [
        (SENSOR, "frame_accepted", 0), (CLIENT, "press_accepted", 2),
        (OTHER, "press_accepted", 3)]
    assert kinds(bench.frame()) == [(SENSOR, "frame_accepted")]


def test_a_frame_that_came_is_kept_whatever_the_sensor_does_then(bench):
    bench.press()
    bench.frame()
    assert bench.say(SENSOR, messages.FrameFailed(capture_id="a", message="?")) == []
    assert bench.say(SENSOR, messages.Goodbye()) == []
    assert bench.wait(SETTINGS.take_timeout_s - 1) == []
    assert (CLIENT, "press_accepted") in kinds(bench.written())


def test_nobody_waits_for_a_disk_that_does_not_answer(bench):
    bench.press(request=7)
    bench.frame()
    (said,) = bench.wait(SETTINGS.take_timeout_s)
    assert (said[0], said[1].kind, said[1].request) == (CLIENT, "request_failed", 7)
    assert "the disk has not answered for 10 s" in said[1].message
    assert bench.wait(1) == []  # once
    assert kinds(bench.press(request=8)) == [(CLIENT, "request_failed")]
    bench.sensor()
    (refused,) = bench.press("b", request=9)
    assert (refused[1].kind, refused[1].reason) == ("press_refused", "disk")
    assert kinds(bench.written()) == [(SENSOR, "frame_accepted"), (CLIENT, "press_accepted")]
    assert kinds(bench.press(request=10)) == [(CLIENT, "press_accepted")]
    assert kinds(bench.press("b", request=11)) == [(SENSOR, "take")]


def test_a_purge_does_not_wait_for_a_disk_that_does_not_answer(bench):
    bench.press()
    bench.frame()
    bench.writer.hangs = True
    for everything in (messages.Purge(request=1, capture_id="a"),
                       messages.Purge(request=2, everything=True)):
        (answer,) = bench.operate(everything)
        assert (answer.kind, answer.message) == (
            "request_failed", "the disk does not answer, nothing was removed")
    bench.writer.hangs = False
    assert bench.operate(messages.Purge(request=3, capture_id="a"))[0].removed == 1


def test_a_frame_that_is_refused_late_is_refused(bench):
    bench.press(request=7)
    bench.frame()
    bench.wait(SETTINGS.take_timeout_s)
    bench.full = True
    assert kinds(bench.written()) == [(SENSOR, "frame_refused"), (CLIENT, "press_refused")]
    bench.full = False
    bench.sensor()
    assert kinds(bench.press(request=8)) == [(SENSOR, "take")]


def test_a_frame_that_cannot_be_written_is_refused_and_may_be_pressed_again(bench):
    bench.press()
    bench.frame()
    bench.full = True
    sent = bench.written()
    assert kinds(sent) == [(SENSOR, "frame_refused"), (CLIENT, "press_refused")]
    assert (sent[1][1].reason, sent[1][1].message) == ("disk", "no room on the disk")
    bench.full = False
    assert kinds(bench.press(request=8)) == [(SENSOR, "take")]
    bench.frame()
    assert (CLIENT, "press_accepted") in kinds(bench.written())


def test_frames_that_wait_together_get_their_rows_together(bench, monkeypatch):
    for capture_id in "abc":
        bench.press(capture_id)
        bench.frame(capture_id)
    rows, real = [], bench.store.accept

    def accept(frames, state):
        rows.append([one.pending.capture_id for one in frames])
        real(frames, state)

    monkeypatch.setattr(bench.store, "accept", accept)
    assert kinds(bench.written()).count((CLIENT, "press_accepted")) == 3
    assert rows == [["a", "b", "c"]]
    assert bench.store.unfinished() == ["a", "b", "c"]


@pytest.mark.parametrize("kind", ["accept", "finish"])
def test_rows_that_cannot_be_written_together_are_written_one_by_one(bench, monkeypatch, kind):
    def fails_for_b(written, state):
        if any(one.pending.capture_id == "b" for one in written):
            raise StoreError("the disk fails")
        real(written, state)

    real = getattr(bench.store, kind)
    bench.now = 5.0
    for capture_id in "abc":
        bench.press(capture_id)
        bench.frame(capture_id)
    if kind == "accept":
        monkeypatch.setattr(bench.store, kind, fails_for_b)
        sent = bench.written()
        answered = {one.capture_id: one.kind for peer, one in sent if peer == CLIENT}
        assert answered == {"a": "press_accepted", "b": "press_refused", "c": "press_accepted"}
        assert bench.store.unfinished() == ["a", "c"]
        assert not bench.store._layout.frame("b").exists()
        return
    bench.written()
    for credit, capture_id in enumerate("abc"):
        bench.worker(credit=credit)
        bench.result(capture_id)
    with monkeypatch.context() as patch:
        patch.setattr(bench.store, kind, fails_for_b)
        bench.written()
        assert [(one.capture_id, one.sequence) for one in bench.published] == [("a", 1), ("c", 2)]
    bench.wait(1.1)
    bench.written()
    assert [(one.capture_id, one.sequence) for one in bench.published[2:]] == [("b", 3)]
    assert bench.store.find("b").attempts == 1


def test_a_face_is_published_when_it_is_safe_and_asked_for_meanwhile_it_is_pending(bench):
    face_comes(bench)
    assert bench.published == []
    assert kinds(bench.say(CLIENT, messages.GetFace(request=4, capture_id="a"))) == [
        (CLIENT, "capture_pending")]
    assert bench.say(CLIENT, messages.GetFace(request=5, capture_id="a", wait_s=9)) == []
    assert kinds(bench.written()) == [(CLIENT, "face_done")]
    assert [one.sequence for one in bench.published] == [1]


def test_a_second_answer_while_the_first_is_written_changes_nothing(bench):
    face_comes(bench)
    bench.result("a", peer=OTHER)
    bench.fail_job(OTHER, "a", final=True)
    bench.fail_job(OTHER, "a", final=False)
    assert len(bench.writer.waiting) == 1
    bench.written()
    assert [one.kind for one in bench.published] == ["face_done"]


def test_a_capture_whose_face_is_being_written_is_given_to_nobody(bench):
    bench.worker()
    bench.press()
    bench.frame()
    bench.written()
    bench.wait(SETTINGS.silence_s + 0.1)  # lost, and queued again
    bench.result("a")  # late
    assert bench.worker(OTHER) == []
    bench.hub.unreachable(WORKER)
    bench.written()
    assert [one.kind for one in bench.published] == ["face_done"]
    assert bench.hub._jobs.queued == 0


def test_the_next_frame_is_given_while_the_face_is_written(bench):
    for capture_id in "ab":
        bench.press(capture_id)
        bench.frame(capture_id)
    bench.written()
    bench.worker()
    bench.result("a")
    assert [one.capture_id for _, one in bench.worker(credit=1)] == ["b"]
    assert bench.published == []


def test_a_purge_waits_for_what_is_being_written(bench):
    bench.press()
    bench.frame()
    (removed,) = bench.operate(messages.Purge(request=1, capture_id="a"))
    assert removed.removed == 1
    assert bench.store.find("a") is None
    assert kinds(bench.press(request=8)) == [(SENSOR, "take")]
    bench.operate(messages.Purge(request=2, everything=True))
    face_comes(bench, "b")
    (removed,) = bench.operate(messages.Purge(request=3, everything=True))
    assert (removed.removed, removed.left) == (1, False)
    assert bench.written() == []
    assert [one.capture_id for one in bench.published] == ["b"]
    assert not list(bench.store._layout.faces.iterdir())


def test_faces_that_the_disk_refused_can_be_purged(bench):
    face_comes(bench)
    bench.full = True
    bench.written()
    bench.operate(messages.Purge(request=3, capture_id="a"))
    bench.full = False
    bench.wait(1.1)
    assert bench.written() == []
    assert (bench.published, bench.store.counts()) == ([], {})


def test_a_hub_that_is_told_to_stop_keeps_what_it_was_writing(bench):
    face_comes(bench)
    bench.press("b")
    bench.frame("b")
    sent = bench._sent(bench.hub.written(bench.now, wait=True))
    assert kinds(sent) == [(SENSOR, "frame_accepted"), (CLIENT, "press_accepted")]
    assert [one.capture_id for one in bench.published] == ["a"]
    assert bench.store.find("b").state is CaptureState.ACCEPTED


def test_a_disk_that_does_not_keep_up_stops_the_work(bench):
    many = IDS[:_MAX_UNSAVED + 1]
    for capture_id in many:
        bench.press(capture_id)
        bench.frame(capture_id)
    bench.written()
    given = []
    for credit in range(len(many)):
        if sent := bench.worker(credit=credit):
            given.append(sent[0][1].capture_id)
            bench.result(given[-1])
    assert given == many[:_MAX_UNSAVED]
    assert (WORKER, "job") in kinds(bench.written())
    assert [one.capture_id for one in bench.published] == given


def test_a_disk_that_does_not_keep_up_refuses_presses(bench):
    for capture_id in IDS[:_MAX_SAVING]:
        bench.press(capture_id)
        bench.frame(capture_id)
    (answer,) = bench.press("more")
    assert (answer[1].reason, answer[1].message) == (
        "disk", f"{_MAX_SAVING} frames wait for the disk already")
    bench.written()
    assert kinds(bench.press("more", request=9)) == [(SENSOR, "take")]


def test_only_so_many_refused_faces_are_held_in_memory(bench):
    many = IDS[:_MAX_UNSAVED + 1]
    for capture_id in many:
        bench.press(capture_id)
        bench.frame(capture_id)
    bench.written()
    for number in range(len(many)):  # each had its frame before the disk was full
        bench.worker(b"w%d" % number)
    bench.full = True
    for number, capture_id in enumerate(many):
        bench.result(capture_id, peer=b"w%d" % number)
    bench.written()
    assert bench.hub._jobs.queued == 1  # to be made again
    bench.full = False
    bench.wait(1.1)
    bench.written()
    assert len(bench.published) == _MAX_UNSAVED
