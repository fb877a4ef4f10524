"""What a peer with a good key says that is not so: the hub is not wrong, stuck or growing by it."""

import pytest

from denseface.recon.face import FaceCandidate
from denseface.service.errors import StoreError
from denseface.service.hub import Hub
from denseface.service.hub.jobs import _MAX_HANDED_BACK
from denseface.service.hub.maintenance import _MAX_ASKED
from denseface.service.hub.outcomes import _MAX_WAITERS_PER_KEY
from denseface.service.hub.peers import MAX_PEERS_PER_KEY
from denseface.service.hub.presses import _MAX_PRESSERS, _MAX_PRESSES_PER_KEY, _MAX_REFUSALS
from denseface.service.protocol import messages
from tests.unit.service.hub.bench import (
    CLIENT,
    FACE,
    FACE_ARRAYS,
    HASH,
    OTHER,
    SENSOR,
    SETTINGS,
    WORKER,
    Bench,
    kinds,
    restarted,
)

LEASE_S = SETTINGS.job_timeout_s + SETTINGS.silence_s


def status(bench: Bench) -> messages.Status:
    (answer,) = bench.say(CLIENT, messages.GetStatus(request=99))
    return answer[1]


def hold(bench: Bench, seconds: float, holding: str = "a", peer: bytes = WORKER) -> list:
    """Say every second that the job is held."""
    sent = []
    for _ in range(round(seconds)):
        bench.say(peer, messages.Heartbeat(holding=holding))
        sent += bench.wait(1.0)
    return sent


def ready(bench: Bench, peer: bytes, key: str, credit: int = 0):
    return bench.say(peer, messages.WorkerReady(name="w", credit=credit), key=key)


def answer(bench: Bench, face=FACE, peer: bytes = WORKER, key: str = "", capture_id: str = "a"):
    return bench.say(peer, messages.Result(
        capture_id=capture_id, settings_hash=HASH, face=face,
        frame_sha256=bench.checksum(capture_id)), FACE_ARRAYS, key)


def test_a_worker_that_holds_its_job_for_ever_loses_it(bench):
    bench.accepted("a")
    bench.worker()
    assert hold(bench, LEASE_S - 1) == []
    bench.worker(OTHER)
    ((peer, job),) = hold(bench, 1)
    assert (peer, job.capture_id, job.attempt) == (OTHER, "a", 2)
    assert WORKER not in bench.hub.peers()
    assert kinds(bench.say(WORKER, messages.Heartbeat(holding="a"))) == [(WORKER, "announce")]
    hold(bench, LEASE_S, peer=OTHER)
    (end,) = bench.published
    assert (end.error, end.dead) == ("JobOverdue", True)
    assert "63 s" in end.message
    assert status(bench).since_start["overdue"] == 2


def test_its_jobs_are_taken_back_where_the_store_cannot_be_read(bench, monkeypatch):
    def broken(*_):
        raise StoreError("database is locked")

    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    hold(bench, LEASE_S - 1)
    with monkeypatch.context() as patch:
        patch.setattr(bench.store, "find", broken)
        patch.setattr(bench.store, "undo_attempt", broken)
        hold(bench, 1)
    assert (bench.hub._jobs.working, bench.hub._jobs.queued) == (0, 2)
    bench.wait(1.1)
    assert kinds(bench.worker(OTHER)) == [(OTHER, "job")]


def test_its_face_may_still_come_late(bench):
    bench.accepted("a")
    bench.worker()
    hold(bench, LEASE_S)
    bench.result()
    assert [one.kind for one in bench.published] == ["face_done"]


def test_each_job_has_its_own_time(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    hold(bench, LEASE_S - 1)
    bench.result("a")
    hold(bench, LEASE_S - 1, "b")
    assert bench.hub._jobs.working == 1
    hold(bench, 1, "b")
    assert (bench.hub._jobs.working, bench.hub._jobs.queued) == (0, 1)


def test_a_job_that_follows_one_that_was_purged_has_time_for_both(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    hold(bench, LEASE_S - 1)
    bench.say(b"o", messages.Purge(request=1, capture_id="a"))
    hold(bench, LEASE_S)
    assert bench.hub._jobs.working == 1
    hold(bench, 1)
    assert bench.hub._jobs.working == 0


def test_the_hub_s_own_standstill_is_not_the_worker_s(bench):
    bench.accepted("a")
    bench.worker()
    bench.now += LEASE_S
    bench.hub.loop_stalled(LEASE_S - 1)
    bench.wait(0)
    assert bench.hub._jobs.working == 1


def test_a_worker_has_two_jobs_however_many_it_asks_for(bench):
    bench.accepted("a", "b", "c")
    for credit in range(9):
        bench.worker(credit=credit)
    assert bench.hub._peers.workers[WORKER].jobs == ["a", "b"]
    bench.result("a")
    assert bench.hub._peers.workers[WORKER].jobs == ["b", "c"]


def test_a_worker_that_hands_back_for_ever_uses_up_the_attempts(bench):
    bench.accepted("a")
    for _ in range(_MAX_HANDED_BACK + SETTINGS.attempts):
        assert bench.published == []
        assert (WORKER, "job") in kinds(bench.worker())
        bench.say(WORKER, messages.Goodbye())
    assert [one.dead for one in bench.published] == [True]


@pytest.mark.parametrize("kind", [messages.Result, messages.JobFailed])
def test_only_a_key_that_was_sent_the_job_answers_it(bench, kind):
    def lie(peer: bytes, key: str) -> None:
        says = {"capture_id": "a", "settings_hash": HASH, "frame_sha256": bench.checksum("a")}
        if kind is messages.Result:
            bench.say(peer, messages.Result(**says, face=FACE), FACE_ARRAYS, key)
        else:
            bench.say(peer, messages.JobFailed(**says, error="E", message="m", final=True), key=key)

    ready(bench, WORKER, "first")
    bench.accepted("a")
    ready(bench, OTHER, "second")
    lie(OTHER, "second")
    assert bench.published == []
    assert status(bench).refused == {"replayed": 1}
    lie(b"the first again", "first")  # connected anew
    assert len(bench.published) == 1


def test_who_was_sent_a_job_by_an_earlier_hub_may_answer(bench):
    ready(bench, WORKER, "first")
    bench.accepted("a")
    again = restarted(bench)
    ready(again, OTHER, "second")
    answer(again, key="first")
    assert [one.kind for one in again.published] == ["face_done"]


def test_a_job_that_nobody_was_sent_has_no_answer(bench):
    bench.accepted("a")
    answer(bench)
    assert bench.published == []
    assert status(bench).refused == {"replayed": 1}


def lying(**changes) -> object:
    report = FACE.report.model_copy(update=changes)
    return FACE.model_copy(update={"report": report})


@pytest.mark.parametrize(("changes", "what"), [
    ({"capture_id": "b"}, "is of capture 'b'"),
    ({"settings": FACE.report.settings.model_copy(update={"ratio": 2.0})}, "other settings"),
    ({"calibration": "another"}, "another calibration"),
    ({"skew_us": 5}, "a skew of 5 us"),
    ({"sensor": "another"}, "another sensor"),
    ({"captured_at": "2026-11-29T12:00:00Z"}, "another captured_at"),
    ({"source": "another.oni#3"}, "another source"),
    ({"face_box": (1, 2, 0, 4)}, "outside the image"),
    ({"face_box": (10, 2, 5, 4)}, "outside the image"),
    ({"face_box": (1, -4, 5, 4)}, "outside the image"),
    ({"face_box": (1, 2, 5, 10**9)}, "outside the image"),
    ({"candidates": (FaceCandidate(box=(0, 0, 5, 4), depth_mm=700.0, width_mm=150.0,
                                   verdict="chosen"),)}, "another box"),
    ({"dense_points": 7}, "the report has"),
    ({"r0_mm": 555.0}, "R0 555 mm"),
    ({"mean_spacing_mm": -1.0}, "below zero"),
    ({"noise_mm": -1.0}, "below zero"),
    ({"timings_ms": {"rbf": 9.0, "total": 1.0}}, "longer than all"),
    ({"timings_ms": {"total": 1e9}}, "longer than the job was out"),
])
def test_a_report_that_is_not_of_this_job_is_a_failed_attempt(bench, changes, what):
    bench.worker()
    bench.accepted("a")
    for credit in (1, 2):
        answer(bench, lying(**changes))
        bench.worker(credit=credit)
    (end,) = bench.published
    assert (end.kind, end.dead) == ("capture_failed", True)
    assert what in end.message
    assert status(bench).refused == {"untrue": 2}


@pytest.mark.parametrize("axis", ["dense_x", "dense_y"])
def test_a_face_off_its_grid_is_a_failed_attempt(bench, axis):
    bench.worker()
    bench.accepted("a")
    places = FACE_ARRAYS[axis].copy()
    places[len(places) // 2] += 0.1
    for credit in (1, 2):
        bench.result(arrays=FACE_ARRAYS | {axis: places})
        bench.worker(credit=credit)
    (end,) = bench.published
    assert f"{axis[-1]} is not on a grid of 2 mm" in end.message
    assert status(bench).refused == {"untrue": 2}


def test_a_late_report_is_checked_after_a_restart_too(bench):
    bench.worker()
    bench.accepted("a")
    again = restarted(bench)
    answer(again, lying(calibration="another"))
    assert again.published == []
    answer(again)
    assert [one.kind for one in again.published] == ["face_done"]


def test_a_frame_larger_than_allowed_is_refused(bench):
    bench = Bench(Hub(bench.store, SETTINGS.model_copy(update={"max_frame_pixels": 69}),
                      FACE.report.settings), bench.store)
    bench.sensor()
    bench.press()
    sensor, presser = bench.frame()
    assert (sensor[0], sensor[1].kind) == (SENSOR, "frame_refused")
    assert (presser[1].kind, presser[1].reason) == ("press_refused", "sensor")
    assert presser[1].message.startswith("color has 10 x 7 pixels, at most 69 allowed")
    assert bench.store.find("a") is None


def test_a_sensor_that_lives_and_gives_nothing_is_not_asked_again(bench):
    bench.sensor()
    bench.say(OTHER, messages.SensorReady(name="other", source="x"))
    assert kinds(bench.press("a")) == [(SENSOR, "take")]
    for _ in range(round(SETTINGS.take_timeout_s)):
        bench.say(SENSOR, messages.Heartbeat())
        bench.say(OTHER, messages.Heartbeat())
        bench.wait(1.0)
    assert kinds(bench.press("b")) == [(OTHER, "take")]
    bench.say(OTHER, messages.Goodbye())
    assert kinds(bench.press("c")) == [(SENSOR, "take")]


@pytest.mark.parametrize("kind", [messages.WorkerReady, messages.SensorReady])
def test_one_key_has_so_many_workers_and_sensors(bench, kind):
    message = kind(name="x", **({"credit": 0} if kind is messages.WorkerReady else {"source": ""}))
    for number in range(MAX_PEERS_PER_KEY):
        assert bench.say(b"%d" % number, message, key="k") == []
    ((_, denied),) = bench.say(b"one more", message, key="k")
    assert denied.message.startswith(f"{MAX_PEERS_PER_KEY} ")
    assert bench.say(b"0", message, key="k") == []
    assert bench.say(OTHER, message, key="another") == []
    assert bench.say(b"local", message) == []
    assert len(bench.hub.peers()) == MAX_PEERS_PER_KEY + 2
    assert status(bench).refused["limit"] == 1


def test_one_key_has_so_many_presses_under_way(bench):
    hub = Hub(bench.store, SETTINGS.model_copy(update={"queue": 1000}), FACE.report.settings)
    bench = Bench(hub, bench.store)
    bench.sensor()

    def press(number: int, key: str):
        return bench.say(CLIENT, messages.Press(request=number, capture_id=f"{key}{number}"),
                         key=key)

    for number in range(_MAX_PRESSES_PER_KEY):
        assert kinds(press(number, "k")) == [(SENSOR, "take")]
    ((_, refused),) = press(999, "k")
    assert (refused.reason, refused.capture_id) == ("queue", "k999")
    assert "of this key" in refused.message
    assert kinds(press(1, "another")) == [(SENSOR, "take")]
    assert status(bench).refused == {"limit": 1}


def test_nobody_makes_the_hub_forget_what_it_refused_to_another(bench):
    (refused,) = bench.say(CLIENT, messages.Press(request=1, capture_id="a"), key="kiosk")
    for number in range(_MAX_REFUSALS + 1):
        bench.say(OTHER, messages.Press(request=number, capture_id="z"), key="flood")
    bench.sensor()
    again = bench.say(CLIENT, messages.Press(request=1, capture_id="a"), key="kiosk")
    assert again == [refused]
    assert bench.store.find("a") is None


def test_the_clients_of_one_press_are_not_counted_without_end(bench):
    bench.sensor()
    for number in range(3 * _MAX_PRESSERS):
        bench.press("a", peer=b"%d" % number)
    assert len(bench.hub._presses._presses["a"].pressers) == _MAX_PRESSERS
    bench.frame()
    assert kinds(bench.press("a", peer=b"150")) == [(b"150", "press_accepted")]


def test_one_key_has_so_many_requests_waiting(bench):
    bench.accepted("a")

    def wait_for_it(number: int, key: str):
        return bench.say(b"%d" % number, messages.GetFace(
            request=1, capture_id="a", wait_s=5), key=key)

    for number in range(_MAX_WAITERS_PER_KEY):
        assert wait_for_it(number, "k") == []
    assert kinds(wait_for_it(999, "k")) == [(b"999", "capture_pending")]
    assert wait_for_it(1000, "another") == []


def test_an_operator_has_so_many_removals_under_way(bench, monkeypatch):
    monkeypatch.setattr(bench.hub._writer, "erase", lambda _: None)
    for number in range(_MAX_ASKED):
        assert bench.say(b"o", messages.Purge(request=number, everything=True)) == []
    ((_, refused),) = bench.say(b"o", messages.Purge(request=999, everything=True))
    assert (refused.kind, refused.request) == ("request_failed", 999)
    assert bench.say(b"o", messages.Purge(request=1, everything=True)) == []  # a repeat
    assert kinds(bench.say(b"o", messages.ListDead(request=1000))) == [(b"o", "dead_letters")]


def test_what_is_known_of_attempts_goes_with_the_outcome(bench):
    bench.accepted("a", "b", "c")
    bench.worker(credit=0)
    bench.fail_job(capture_id="a")
    bench.worker(credit=1)
    bench.result("a")
    bench.worker(credit=2)
    bench.fail_job(capture_id="b", final=True)
    bench.worker(credit=3)
    bench.say(b"o", messages.Purge(request=1, capture_id="c"))
    assert [one.kind for one in bench.published] == ["face_done", "capture_failed"]
    assert bench.hub._jobs._attempts == {}


def test_nothing_is_kept_of_a_job_that_another_worker_ended(bench):
    bench.accepted("a")
    bench.worker()
    bench.hub.unreachable(WORKER)
    assert kinds(bench.worker(OTHER)) == [(OTHER, "job")]
    bench.result("a")  # the first one's, late
    bench.say(OTHER, messages.Goodbye())
    assert len(bench.published) == 1
    assert bench.hub._jobs._attempts == {}
