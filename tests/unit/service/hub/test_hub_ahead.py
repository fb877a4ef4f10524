"""A worker gets its next job before it has answered the last."""

from denseface.service.errors import StoreError
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from tests.unit.service.hub.bench import HASH, OTHER, SETTINGS, WORKER, Bench


def jobs(sent) -> list[tuple[bytes, str, int]]:
    return [(peer, one.capture_id, one.attempt) for peer, one in sent
            if isinstance(one, messages.Job)]


def attempts(bench: Bench, *capture_ids: str) -> list[int]:
    return [bench.store.find(one).attempts for one in capture_ids]


def replays(bench: Bench) -> int:
    return bench.hub._rejections.counts().get("replayed", 0)


def test_one_job_for_each_credit_before_the_first_answer(bench):
    bench.accepted("a", "b", "c")
    assert jobs(bench.worker(credit=0)) == [(WORKER, "a", 1)]
    assert jobs(bench.worker(credit=1)) == [(WORKER, "b", 1)]
    assert jobs(bench.worker(credit=1)) == []
    assert jobs(bench.result("a")) == []
    assert jobs(bench.worker(credit=2)) == [(WORKER, "c", 1)]
    bench.result("b")
    bench.result("c")
    assert [one.capture_id for one in bench.published] == ["a", "b", "c"]


def test_a_worker_without_a_job_comes_first(bench):
    bench.worker(credit=0)
    bench.worker(OTHER, credit=0)
    bench.sensor()
    for capture_id, expected in (("a", WORKER), ("b", OTHER)):
        bench.press(capture_id)
        assert jobs(bench.frame(capture_id)) == [(expected, capture_id, 1)]
        bench.worker(expected, credit=1)
    bench.result("b", peer=OTHER)
    bench.press("c")
    assert jobs(bench.frame("c")) == [(OTHER, "c", 1)]


def test_a_frame_that_was_not_begun_loses_no_attempt_with_its_worker(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    assert attempts(bench, "a", "b") == [1, 1]
    bench.hub.unreachable(WORKER)
    assert attempts(bench, "a", "b") == [1, 0]
    assert jobs(bench.worker(OTHER)) == [(OTHER, "a", 2)]


def test_a_frame_that_was_tried_before_has_a_worker_for_itself(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.fail_job(capture_id="a")
    assert jobs(bench.worker(credit=1)) == [(WORKER, "a", 2)]
    assert jobs(bench.worker(credit=2)) == []  # none behind it
    bench.worker(OTHER, credit=0)
    assert attempts(bench, "b") == [1]
    bench.result("a")
    bench.sensor()
    bench.press("c")
    assert jobs(bench.frame("c")) == [(WORKER, "c", 1)]
    bench.worker(OTHER, credit=1)
    bench.fail_job(OTHER, "b")  # and it is behind none
    bench.worker(WORKER, credit=3)
    assert attempts(bench, "b") == [2]
    assert bench.hub._peers.workers[OTHER].jobs == ["b"]


def test_a_worker_that_leaves_hands_back_both_in_order(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    bench.say(WORKER, messages.Goodbye())
    assert attempts(bench, "a", "b") == [0, 0]
    assert jobs(bench.worker(OTHER, credit=0)) == [(OTHER, "a", 1)]
    assert jobs(bench.worker(OTHER, credit=1)) == [(OTHER, "b", 1)]


def test_an_answer_that_does_not_come_before_the_next_one_is_lost(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    bench.result("b")
    assert [one.capture_id for one in bench.published] == ["b"]
    assert jobs(bench.worker(credit=2)) == [(WORKER, "a", 2)]


def test_a_worker_is_alive_that_holds_one_of_its_jobs(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    for holding in ("a", "a", "a", "b", "b", "b"):
        bench.now += 1
        bench.say(WORKER, messages.Heartbeat(holding=holding))
        bench.wait(0)
    assert bench.hub._jobs.working == 2
    for _ in range(4):
        bench.now += 1
        bench.say(WORKER, messages.Heartbeat())
    bench.wait(0)
    assert (bench.hub._jobs.working, bench.hub._jobs.queued) == (0, 2)


def test_what_is_purged_leaves_the_other_job_where_it_is(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    checksum = bench.checksum("a")
    bench.say(b"o", messages.Purge(request=1, capture_id="a"))
    bench.result("a", frame_sha256=checksum)
    assert bench.published == []
    bench.result("b")
    assert [one.capture_id for one in bench.published] == ["b"]


def test_a_store_that_cannot_be_read_when_a_worker_goes_loses_no_job(bench, monkeypatch):
    def broken(*_):
        raise StoreError("database is locked")

    for go in (lambda: bench.hub.unreachable(WORKER),
               lambda: bench.say(WORKER, messages.Goodbye())):
        bench.accepted("a")
        bench.worker(credit=0)
        with monkeypatch.context() as patch:
            patch.setattr(bench.store, "find", broken)
            patch.setattr(bench.store, "undo_attempt", broken)
            go()
        bench.wait(1.1)
        assert jobs(bench.worker(OTHER, credit=0)) == [(OTHER, "a", 2)]
        bench.result("a", peer=OTHER)
        assert bench.store.find("a").state is CaptureState.DONE
        bench.say(b"o", messages.Purge(request=1, capture_id="a"))
        bench.say(OTHER, messages.Goodbye())


def test_a_restarted_hub_takes_the_answers_of_both(bench):
    bench.accepted("a", "b")
    bench.worker(credit=0)
    bench.worker(credit=1)
    again = Bench(Hub(bench.store, SETTINGS, bench.hub._presses._recon), bench.store, bench.now)
    assert again.say(WORKER, messages.Heartbeat(holding="a"))[0][1].kind == "announce"
    for capture_id in ("a", "b"):
        again.result(capture_id, hashed=HASH)
    assert [one.capture_id for one in again.published] == ["a", "b"]


def test_what_the_network_held_back_is_no_replay(bench):
    """All its heartbeats come at once, each is answered, and so is each answer."""
    bench.worker(credit=3)
    bench.wait(SETTINGS.silence_s + 1)
    asked = [sent for _ in range(9) for sent in bench.say(WORKER, messages.Heartbeat())]
    assert asked == [(WORKER, messages.Announce())] * 9
    for _ in range(9):
        bench.worker(credit=3)
    assert replays(bench) == 0
    bench.accepted("a")
    bench.worker(credit=3)  # nobody asked for this one
    assert replays(bench) == 1
    assert bench.store.find("a").attempts == 1


def test_the_answer_of_a_worker_that_was_away_is_no_replay(bench):
    bench.accepted("a")
    bench.worker()
    bench.now += SETTINGS.silence_s + 0.1
    bench.wait(0)
    assert jobs(bench.worker(OTHER)) == [(OTHER, "a", 2)]
    bench.result(peer=OTHER)
    bench.result(peer=WORKER)
    assert len(bench.published) == 1
    assert replays(bench) == 0
    bench.result(peer=WORKER)  # one job, one answer
    assert replays(bench) == 1


def test_the_answer_to_a_job_that_was_removed_is_no_replay(bench):
    bench.accepted("a")
    bench.worker()
    checksum = bench.checksum("a")
    bench.say(OTHER, messages.Purge(request=1, capture_id="a"))
    bench.result(frame_sha256=checksum)
    assert (bench.published, replays(bench)) == ([], 0)
