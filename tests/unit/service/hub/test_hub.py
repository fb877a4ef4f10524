"""The hub without a socket: from a press to an outcome, and what may go wrong between."""

import numpy as np
import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import StoreError
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from tests.unit.service.hub.bench import (
    CLIENT,
    FACE,
    FACE_ARRAYS,
    FRAME,
    FRAME_ARRAYS,
    HASH,
    OTHER,
    SENSOR,
    SETTINGS,
    WORKER,
    Bench,
    kinds,
    restarted,
)


def test_from_press_to_published_face(bench):
    bench.sensor()
    assert bench.worker() == []
    assert kinds(bench.press()) == [(SENSOR, "take")]
    sent = bench.frame()
    assert kinds(sent) == [(SENSOR, "frame_accepted"), (CLIENT, "press_accepted"), (WORKER, "job")]
    assert sent[1][1].request == 7
    assert (sent[2][1].settings, sent[2][1].settings_hash) == (Settings(), HASH)
    assert bench.say(CLIENT, messages.GetFace(request=8, capture_id="a", wait_s=5)) == []
    (answered,) = bench.result()
    assert answered[0] == CLIENT
    assert (answered[1].kind, answered[1].request, answered[1].sequence) == ("face_done", 8, 1)
    (published,) = bench.published
    assert (published.kind, published.request, published.sequence) == ("face_done", 0, 1)
    assert published.epoch == bench.store.epoch


def test_accepted_is_not_said_before_the_frame_is_in_the_store(bench, monkeypatch):
    def full(*_):
        raise StoreError("No space left on device")

    bench.sensor()
    bench.worker()
    bench.press()
    monkeypatch.setattr(bench.store, "accept", full)
    sent = bench.frame()
    assert kinds(sent) == [(SENSOR, "frame_refused"), (CLIENT, "press_refused")]
    assert "No space" in sent[1][1].message
    monkeypatch.undo()
    assert kinds(bench.press(request=8)) == [(SENSOR, "take")]


def test_a_press_without_a_sensor_is_refused(bench):
    (answer,) = bench.press()
    assert (answer[1].kind, answer[1].message) == ("press_refused", "no sensor is connected")


def test_a_repeated_press_is_the_same_capture(bench):
    bench.sensor()
    bench.press(request=1)
    assert bench.press(request=2) == []
    assert bench.press(request=3, peer=OTHER) == []
    sent = bench.frame()
    assert [(peer, message.request) for peer, message in sent[1:]] == [(CLIENT, 2), (OTHER, 3)]
    assert kinds(bench.press(request=4)) == [(CLIENT, "press_accepted")]
    bench.worker()
    bench.result()
    assert kinds(bench.press(request=5)) == [(CLIENT, "press_accepted")]
    assert bench.store.counts() == {CaptureState.DONE: 1}


def test_a_sensor_that_gives_no_frame_refuses_the_press(bench):
    bench.sensor()
    bench.press()
    assert kinds(bench.say(SENSOR, messages.FrameFailed(capture_id="a", message="unplugged"))) == [
        (CLIENT, "press_refused")]
    bench.press(request=8)
    bench.now += SETTINGS.take_timeout_s
    bench.say(SENSOR, messages.Heartbeat())
    (answer,) = bench.wait(0)
    assert "no frame from the sensor in 10 s" in answer[1].message
    assert kinds(bench.frame()) == [(SENSOR, "frame_refused")]
    assert bench.store.counts() == {}


def test_a_sensor_that_goes_away_refuses_its_presses(bench):
    bench.sensor()
    bench.press()
    assert kinds(bench.say(SENSOR, messages.Goodbye())) == [(CLIENT, "press_refused")]
    assert bench.press("b")[0][1].message == "no sensor is connected"


def test_a_full_queue_refuses(bench):
    bench.accepted("a", "b", "c")
    assert "3 frames wait" in bench.press("d")[0][1].message


def test_a_frame_sent_twice_is_accepted_twice_and_kept_once(bench):
    bench.accepted("a")
    assert kinds(bench.frame()) == [(SENSOR, "frame_accepted")]
    assert bench.store.unfinished() == ["a"]


def test_no_face_ends_the_capture_at_once(bench):
    bench.accepted("a")
    bench.worker()
    bench.say(CLIENT, messages.GetFace(request=1, capture_id="a", wait_s=5))
    assert kinds(bench.fail_job(final=True)) == [(CLIENT, "capture_failed")]
    (published,) = bench.published
    assert (published.error, published.message, published.dead) == ("Error", "why", False)


def test_a_silent_worker_s_job_goes_to_another(bench):
    bench.accepted("a")
    bench.worker()
    assert bench.worker(OTHER) == []
    bench.now += SETTINGS.silence_s + 0.1
    bench.say(OTHER, messages.Heartbeat())
    sent = bench.wait(0)
    assert [(peer, message.attempt) for peer, message in sent] == [(OTHER, 2)]


def test_a_worker_that_lives_without_its_job_loses_it(bench):
    bench.accepted("a")
    bench.worker()
    for _ in range(4):
        bench.now += 1
        bench.say(WORKER, messages.Heartbeat(holding=None))
    bench.wait(0)
    assert kinds(bench.say(WORKER, messages.Heartbeat())) == [(WORKER, "announce")]
    assert kinds(bench.worker(credit=1)) == [(WORKER, "job")]


def test_a_worker_that_holds_its_job_keeps_it(bench):
    bench.accepted("a")
    bench.worker()
    for _ in range(9):
        bench.now += 1
        bench.say(WORKER, messages.Heartbeat(holding="a"))
        assert bench.wait(0) == []


def test_repeated_ready_gives_one_job(bench):
    bench.accepted("a", "b")
    assert kinds(bench.worker(credit=4)) == [(WORKER, "job")]
    assert bench.worker(credit=4) == []
    bench.result("a")
    assert bench.worker(credit=4) == []
    assert kinds(bench.worker(credit=5)) == [(WORKER, "job")]


def test_after_the_last_attempt_a_dead_letter(bench):
    bench.accepted("a")
    bench.worker()
    bench.fail_job()
    assert bench.worker(credit=1)[0][1].attempt == 2
    bench.fail_job()
    (published,) = bench.published
    assert (published.kind, published.dead, published.message) == ("capture_failed", True, "why")
    assert bench.store.find("a").state is CaptureState.DEAD
    bench.store.frame("a")
    bench.result()
    assert len(bench.published) == 1


def test_a_worker_that_says_goodbye_hands_back_its_job_and_no_attempt_is_lost(bench):
    bench.accepted("a")
    for credit in range(5):
        (job,) = bench.worker(credit=credit)
        assert (job[1].kind, job[1].attempt) == ("job", 1)
        assert bench.say(WORKER, messages.Goodbye()) == []
    assert bench.worker(OTHER)[0][1].attempt == 1
    bench.result(peer=OTHER)
    assert [one.kind for one in bench.published] == ["face_done"]
    assert bench.say(OTHER, messages.Goodbye()) == []
    assert bench.store.find("a").attempts == 1


def test_a_full_disk_does_not_keep_a_job_from_being_handed_back(bench, monkeypatch):
    def full(*_):
        raise StoreError("No space left on device")

    bench.accepted("a")
    bench.worker()
    with monkeypatch.context() as patch:
        patch.setattr(bench.store, "undo_attempt", full)
        assert bench.say(WORKER, messages.Goodbye()) == []
    (job,) = bench.worker(OTHER)
    assert (job[1].kind, job[1].attempt) == ("job", 2)


def test_a_repeat_of_a_refused_press_is_refused_though_a_sensor_came_meanwhile(bench):
    (refused,) = bench.press("a", request=7)
    bench.sensor()
    assert bench.press("a", request=7) == [refused]
    assert kinds(bench.press("a", request=8)) == [(SENSOR, "take")]
    assert bench.wait(11) == [(CLIENT, messages.PressRefused(
        request=8, capture_id="a", reason="timeout", message="no frame from the sensor in 10 s"))]
    assert kinds(bench.press("a", request=8)) == [(CLIENT, "press_refused")]


def test_a_worker_whose_ready_was_lost_is_asked_again(bench):
    bench.worker()
    bench.accepted("a")
    bench.result()
    # The WorkerReady that follows each answer does not arrive, the heartbeats do.
    heartbeat = messages.Heartbeat()
    assert kinds(bench.say(WORKER, heartbeat)) == [(WORKER, "announce")]
    assert bench.worker(credit=1) == []
    assert bench.say(WORKER, heartbeat) == []
    bench.press("b")
    assert (WORKER, "job") in kinds(bench.frame("b"))
    assert bench.say(WORKER, messages.Heartbeat(holding="b")) == []


def test_silence_while_the_event_loop_was_stalled_is_forgiven(bench):
    bench.accepted("a")
    bench.worker()
    bench.now += 60
    bench.hub.loop_stalled(59.9)
    assert bench.wait(0) == []
    assert (len(bench.hub.peers()), bench.hub._jobs.working) == (2, 1)
    bench.wait(4)
    assert bench.hub.peers() == []


def test_an_unreachable_worker_s_job_is_sent_to_another(bench):
    bench.accepted("a")
    bench.worker()
    bench.hub.unreachable(WORKER)
    assert kinds(bench.worker(OTHER)) == [(OTHER, "job")]


def test_the_first_of_two_results_counts(bench):
    bench.accepted("a")
    bench.worker()
    bench.wait(SETTINGS.silence_s + 0.1)
    bench.worker(OTHER)
    bench.result(peer=WORKER)
    bench.result(peer=OTHER)
    assert [message.sequence for message in bench.published] == [1]


def test_a_late_result_of_a_lost_worker_is_taken(bench):
    bench.accepted("a")
    bench.worker()
    bench.wait(SETTINGS.silence_s + 0.1)
    bench.result()
    assert bench.published[0].kind == "face_done"
    assert bench.worker(OTHER) == []


@pytest.mark.parametrize(("capture_id", "hashed"), [("z", HASH), ("a", "00")])
def test_results_that_nobody_asked_for_are_dropped(bench, capture_id, hashed):
    bench.accepted("a")
    bench.worker()
    bench.result(capture_id, hashed=hashed)
    assert bench.published == []


def test_a_result_with_a_bad_face_is_tried_again(bench):
    bench.accepted("a")
    bench.worker()
    bad = FACE_ARRAYS | {"dense_z": FACE_ARRAYS["dense_z"] + np.float32("inf")}
    bench.result(arrays=bad)
    assert bench.published == []
    assert bench.worker(credit=1)[0][1].attempt == 2


def test_a_damaged_frame_becomes_a_dead_letter(bench, tmp_path):
    bench.accepted("a", "b")
    bench.store._frame_cache.pop("a")  # as after a restart
    (tmp_path / "data" / "frames" / "a.frame").write_bytes(b"damaged")
    (job,) = bench.worker()
    assert job[1].capture_id == "b"
    assert (bench.published[0].error, bench.published[0].dead) == ("CorruptFileError", True)


def test_a_restarted_hub_resumes_what_was_accepted(bench):
    bench.accepted("a", "b")
    bench.worker()
    again = restarted(bench)
    assert kinds(again.say(WORKER, messages.Heartbeat(holding="a"))) == [(WORKER, "announce")]
    (job,) = again.worker(OTHER)
    assert (job[1].capture_id, job[1].attempt) == ("a", 2)
    again.result("a", peer=WORKER)
    assert [message.capture_id for message in again.published] == ["a"]
    assert kinds(again.press("b")) == [(CLIENT, "press_accepted")]


def test_a_hub_that_died_at_every_attempt_gives_up(bench):
    bench.accepted("a")
    for attempt in (1, 2):
        bench = restarted(bench)
        assert bench.worker()[0][1].attempt == attempt
    bench = restarted(bench)
    assert bench.worker() == []
    assert bench.published[0].dead


def test_a_hub_that_has_just_started_waits_for_its_sensor(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        hub = Hub(store, SETTINGS, Settings(), opened=100.0)
        bench = Bench(hub, store, 100.0)
        assert bench.press() == []
        bench.now += SETTINGS.silence_s - 0.1
        assert bench.press() == []
        bench.sensor()
        assert kinds(bench.press()) == [(SENSOR, "take")]
        bench.say(SENSOR, messages.Goodbye())
        bench.now += 0.1
        assert kinds(bench.press("b", request=8)) == [(CLIENT, "press_refused")]


def test_status_counts(bench):
    bench.accepted("a", "b")
    bench.worker()
    (answer,) = bench.say(CLIENT, messages.GetStatus(request=3))
    status = answer[1]
    assert (status.ready, status.queued, status.working, status.done) == (True, 1, 1, 0)
    assert not restarted(bench).say(CLIENT, messages.GetStatus(request=3))[0][1].ready


def test_an_answer_to_another_job_does_not_lose_the_capture(bench):
    bench.accepted("a")
    bench.worker()
    bench.result(hashed="00")
    assert kinds(bench.worker(credit=1)) == [(WORKER, "job")]


def test_only_the_sensor_that_was_asked_answers_a_take(bench):
    bench.sensor()
    bench.press()
    bench.say(OTHER, messages.SensorReady(name="other", source="y.oni"))
    answers = bench.say(OTHER, messages.Frame(capture_id="a", frame=FRAME), FRAME_ARRAYS)
    assert [(peer, message.kind) for peer, message in answers] == [(OTHER, "frame_refused")]
    assert bench.say(OTHER, messages.FrameFailed(capture_id="a", message="none")) == []
    assert bench.store.find("a") is None
    assert bench.hub._status.make().refused == {"not asked": 2}
    assert (CLIENT, "press_accepted") in [
        (peer, message.kind) for peer, message in bench.frame()]


def test_a_report_that_contradicts_its_face_is_a_failed_attempt(bench):
    bench.worker()
    bench.accepted("a")
    lying = FACE.model_copy(update={"report": FACE.report.model_copy(
        update={"dense_points": FACE.dense_points + 1})})
    for credit in (1, 2):
        bench.say(WORKER, messages.Result(
            capture_id="a", settings_hash=HASH, face=lying,
            frame_sha256=bench.checksum("a")), FACE_ARRAYS)
        bench.worker(credit=credit)
    assert [message.kind for message in bench.published] == ["capture_failed"]
    assert bench.published[0].dead
    assert "the report has" in bench.published[0].message


def test_a_status_that_cannot_be_made_does_not_end_the_hub(bench):
    for number in range(65):  # a status holds 64
        bench.hub._rejections.note(f"reason {number}")
    assert bench.wait(5) == []
    (answer,) = bench.say(CLIENT, messages.GetStatus(request=3))
    assert answer[1].kind == "request_failed"
    assert "refused" in answer[1].message
