"""A worker gets its next frame before its answer is kept."""

from service import messages
from service.errors import DiskFullError
from service.states import CaptureState
from service.wire import Packet
from tests.unit.service.test_hub import CLIENT, FACE, FACE_ARRAYS, OTHER, WORKER, Bench, bench

__all__ = ["bench"]


def given(outputs) -> list[tuple[bytes, str]]:
    return [(one.peer, one.packet.message.capture_id) for one in outputs]


def answer(bench: Bench, capture_id: str, **changes) -> Packet:
    stored = bench.store.find(capture_id)
    return Packet(messages.Result(**{
        "capture_id": capture_id, "settings_hash": stored.settings_hash,
        "frame_sha256": stored.frame_sha256, "face": FACE} | changes), FACE_ARRAYS)


def test_the_next_frame_goes_out_while_the_answer_is_not_yet_kept(bench):
    bench.accepted("a", "b")
    bench.worker()
    packet = answer(bench, "a")
    assert given(bench.hub.next_job(bench.now, WORKER, packet)) == [(WORKER, "b")]
    assert bench.store.find("a").state is CaptureState.ACCEPTED
    assert bench.published == []
    bench._sent(bench.hub.receive(bench.now, WORKER, packet))
    assert [one.capture_id for one in bench.published] == ["a"]
    # What the worker says next of itself is known already: it neither gets nor loses a job.
    assert bench.worker(credit=1) == []
    bench.result("b")
    assert [one.capture_id for one in bench.published] == ["a", "b"]
    assert bench.store.find("b").attempts == 1


def test_what_it_then_says_of_itself_is_a_replay_only_the_second_time(bench):
    bench.accepted("a", "b")
    bench.worker()
    for credit, capture_id in enumerate(("a", "b"), start=1):
        packet = answer(bench, capture_id)
        bench.hub.next_job(bench.now, WORKER, packet)
        bench._sent(bench.hub.receive(bench.now, WORKER, packet))
        bench.worker(credit=credit)
    assert bench.hub._refusals.counts() == {}
    bench.worker(credit=2)
    assert bench.hub._refusals.counts() == {"replayed": 1}


def test_with_nothing_to_do_it_is_free_until_the_next_press(bench):
    bench.accepted("a")
    bench.worker()
    packet = answer(bench, "a")
    assert bench.hub.next_job(bench.now, WORKER, packet) == []
    bench._sent(bench.hub.receive(bench.now, WORKER, packet))
    bench.worker(credit=1)
    bench.accepted("b")
    assert bench.store.find("b").attempts == 1
    bench.accepted("c")  # one frame for one credit
    assert bench.store.find("c").attempts == 0


def test_a_worker_that_leaves_instead_hands_it_back(bench):
    bench.accepted("a", "b")
    bench.worker()
    packet = answer(bench, "a")
    bench.hub.next_job(bench.now, WORKER, packet)
    bench._sent(bench.hub.receive(bench.now, WORKER, packet))
    bench.say(WORKER, messages.Goodbye())
    assert bench.store.find("b").attempts == 0
    assert ("b", 1) in [(one.capture_id, one.attempt) for _, one in bench.worker(OTHER)
                        if isinstance(one, messages.Job)]


def test_an_answer_that_is_of_no_use_gives_nothing_and_loses_nothing(bench):
    bench.accepted("a", "b")
    bench.worker()
    for packet in (answer(bench, "a", settings_hash="0f"), answer(bench, "b")):
        assert bench.hub.next_job(bench.now, WORKER, packet) == []
    assert bench.hub.next_job(bench.now, OTHER, answer(bench, "a")) == []
    assert bench.hub.next_job(bench.now, CLIENT, Packet(messages.Goodbye())) == []
    bench.say(WORKER, answer(bench, "a", settings_hash="0f").message, FACE_ARRAYS)
    bench.worker(credit=1)
    assert bench.store.find("a").attempts == 2  # again, and to the same


def test_on_a_full_disk_the_answer_is_kept_later_and_nothing_new_is_begun(bench, monkeypatch):
    bench.accepted("a", "b")
    bench.worker()
    packet = answer(bench, "a")

    def full(*_: object, **__: object) -> None:
        raise DiskFullError("no room on the disk")

    with monkeypatch.context() as disk:
        disk.setattr(bench.store, "start_attempt", full)
        disk.setattr(bench.store, "finish", full)
        assert bench.hub.next_job(bench.now, WORKER, packet) == []
        assert bench.hub.receive(bench.now, WORKER, packet) == []
    bench.wait(2.0)
    assert [one.capture_id for one in bench.published] == ["a"]
    assert bench.store.find("b").attempts == 1
