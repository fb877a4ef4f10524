"""Requests for a face that is there, and those that wait for one."""

from denseface.service.protocol import messages
from tests.unit.service.hub.bench import CLIENT, FRAME, FRAME_ARRAYS, WORKER, kinds


def test_waiting_for_a_face_ends(bench):
    bench.accepted("a")
    assert bench.say(CLIENT, messages.GetFace(request=5, capture_id="a", wait_s=2)) == []
    assert bench.wait(1.9) == []
    assert kinds(bench.wait(0.2)) == [(CLIENT, "capture_pending")]
    assert kinds(bench.say(CLIENT, messages.GetFace(request=6, capture_id="z"))) == [
        (CLIENT, "capture_unknown")]


def test_repeating_a_request_does_not_prolong_its_wait(bench):
    bench.accepted("a")
    ask = messages.GetFace(request=5, capture_id="a", wait_s=2)
    for _ in range(3):
        assert bench.say(CLIENT, ask) == []
        assert bench.wait(0.6) == []
    assert kinds(bench.wait(0.3)) == [(CLIENT, "capture_pending")]


def test_a_client_may_wait_for_several_captures(bench):
    bench.accepted("a", "b")
    for request, capture_id in ((5, "a"), (6, "b"), (7, "a")):
        assert bench.say(CLIENT, messages.GetFace(
            request=request, capture_id=capture_id, wait_s=9)) == []
    bench.worker()
    assert [(one.kind, one.request) for peer, one in bench.result("a") if peer == CLIENT] == [
        ("face_done", 5), ("face_done", 7)]
    bench.worker(credit=1)
    assert [(one.kind, one.request) for peer, one in bench.result("b") if peer == CLIENT] == [
        ("face_done", 6)]


def test_the_requests_of_one_client_that_wait_are_limited(bench):
    bench.accepted("a")
    answered = {
        client: [bool(bench.say(client, messages.GetFace(
            request=request, capture_id="a", wait_s=9))) for request in range(200)]
        for client in (CLIENT, b"other")}
    assert answered[CLIENT] == [False] * 100 + [True] * 100
    assert answered[b"other"] == answered[CLIENT]


def test_outcomes_can_be_asked_for_in_order(bench):
    bench.accepted("a", "b")
    bench.worker()
    bench.result("a")
    bench.worker(credit=1)
    bench.result("b")

    def after(number):
        return bench.say(CLIENT, messages.GetNext(request=1, after=number))[0][1]

    assert [after(0).capture_id, after(1).capture_id] == ["a", "b"]
    assert (after(2).kind, after(2).sequence) == ("nothing_newer", 2)


def test_a_frame_is_given_whatever_became_of_it_and_goes_to_a_worker_all_the_same(bench):
    bench.accepted("a", "b")
    for capture_id in ("a", "b", "a"):
        ((peer, kept),) = bench.say(CLIENT, messages.GetFrame(request=5, capture_id=capture_id))
        assert (peer, kept.kind, kept.request) == (CLIENT, "frame_kept", 5)
        assert (kept.capture_id, kept.frame) == (capture_id, FRAME)
    bench.worker()
    assert bench.fail_job(capture_id="a", final=True) == []
    assert kinds(bench.worker(credit=1)) == [(WORKER, "job")]
    packet = bench.store.kept_frame("a")
    assert {name: array.tobytes() for name, array in packet.arrays.items()} == {
        name: array.tobytes() for name, array in FRAME_ARRAYS.items()}
    assert kinds(bench.say(CLIENT, messages.GetFrame(request=6, capture_id="z"))) == [
        (CLIENT, "capture_unknown")]
    bench.say(b"operator", messages.Purge(request=1, capture_id="a"))
    assert kinds(bench.say(CLIENT, messages.GetFrame(request=7, capture_id="a"))) == [
        (CLIENT, "capture_unknown")]


def test_a_damaged_frame_is_said_to_be(bench, tmp_path):
    bench.accepted("a")
    bench.worker()
    bench.result()
    (file,) = (tmp_path / "data/frames").iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    ((_, failed),) = bench.say(CLIENT, messages.GetFrame(request=6, capture_id="a"))
    assert (failed.kind, failed.request) == ("request_failed", 6)
    assert "a.frame" in failed.message
