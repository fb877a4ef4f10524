"""Whoever pressed has it removed, wherever it stands, and nobody else's."""

import itertools

import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.roles import Role
from denseface.service.storage import FolderStore
from tests.unit.service.clocks import FakeClock
from tests.unit.service.hub.bench import CLIENT, OTHER, SENSOR, SETTINGS, WORKER, Bench, kinds
from tests.unit.service.hub.test_erasing import HeldWriter

KEY, ANOTHERS = "0123456789abcdef", "fedcba9876543210"
ID = "withdrawn-one"
PRESSER = frozenset({Role.PRESSER})
REQUEST = itertools.count(1000)


def withdraw(bench, capture_id=ID, key=KEY, roles=PRESSER, request=None):
    return bench.say(CLIENT, messages.Withdraw(
        request=next(REQUEST) if request is None else request, capture_id=capture_id),
        key=key, roles=roles)


def removed(sent):
    """How many, of the one answer that is `removed`."""
    (answer,) = [one for peer, one in sent if peer == CLIENT and one.kind == "removed"]
    assert not answer.left
    return answer.removed


def left(tmp_path, *words):
    """Files of the data folder that hold one of these words, or are named by one."""
    return [path.name for path in (tmp_path / "data").rglob("*") if path.is_file() and any(
        word.encode() in path.read_bytes() or word in path.name for word in words)]


def pressed(bench):
    bench.sensor()
    bench.press(ID, key=KEY)


def accepted(bench):
    pressed(bench)
    bench.frame(ID)


def working(bench):
    accepted(bench)
    bench.worker()


def done(bench):
    working(bench)
    bench.result(ID)


def failed(bench):
    working(bench)
    bench.fail_job(capture_id=ID, final=True)


def dead(bench):
    accepted(bench)
    for credit in range(SETTINGS.attempts):
        bench.worker(WORKER, credit)
        bench.fail_job(capture_id=ID)


@pytest.mark.parametrize(("reach", "count"), [
    (pressed, 0), (accepted, 1), (working, 1), (done, 1), (failed, 1), (dead, 1)])
def test_nothing_is_left_whatever_its_state(bench, tmp_path, reach, count):
    reach(bench)
    sent = withdraw(bench)
    assert removed(sent) == count
    assert left(tmp_path, ID) == []
    assert kinds(bench.say(CLIENT, messages.GetFace(request=1, capture_id=ID))) == [
        (CLIENT, "capture_unknown")]
    assert removed(withdraw(bench)) == 0


def test_a_press_that_waits_for_its_frame_is_refused_and_the_frame_is_not_taken(bench, tmp_path):
    pressed(bench)
    sent = withdraw(bench)
    (refused,) = [one for _, one in sent if one.kind == "press_refused"]
    assert (refused.reason, refused.message) == ("purged", "it was withdrawn")
    assert kinds(bench.frame(ID)) == [(SENSOR, "frame_refused")]
    assert left(tmp_path, ID) == []


def test_a_face_that_was_being_made_is_dropped(bench, tmp_path):
    working(bench)
    checksum = bench.checksum(ID)
    withdraw(bench)
    assert bench.result(ID, frame_sha256=checksum) == []
    assert bench.published == []
    assert left(tmp_path, ID) == []


def test_a_press_that_comes_late_makes_no_picture(bench):
    done(bench)
    withdraw(bench)
    for request in (7, 8):
        assert kinds(bench.press(ID, request, key=KEY)) == [(CLIENT, "press_refused")]


def test_a_withdrawal_that_overtakes_its_press_holds(bench):
    bench.sensor()
    assert removed(withdraw(bench)) == 0
    assert kinds(bench.press(ID, key=KEY)) == [(CLIENT, "press_refused")]
    assert kinds(bench.press(ID, key=ANOTHERS)) == [(SENSOR, "take")]


@pytest.mark.parametrize("reach", [pressed, accepted, done])
def test_anothers_capture_stays_and_the_answer_is_that_for_none(bench, reach):
    reach(bench)
    assert [one for _, one in withdraw(bench, key=ANOTHERS, request=1)] == [
        messages.Removed(request=1, removed=0, left=False)]
    assert [one for _, one in withdraw(bench, "no-such", key=ANOTHERS, request=1)] == [
        messages.Removed(request=1, removed=0, left=False)]
    assert bench.hub._presses.pressed_by(ID) == KEY
    for capture_id in (ID, "no-such"):  # nor does a press tell them apart
        assert kinds(bench.press(capture_id, 9, OTHER, key=ANOTHERS)) == [
            (OTHER, "press_refused")]


@pytest.mark.parametrize(("key", "roles"), [
    ("", frozenset(Role)), (ANOTHERS, frozenset({Role.OPERATOR}))])
def test_an_operator_and_the_local_door_withdraw_anybodys(bench, tmp_path, key, roles):
    done(bench)
    assert removed(withdraw(bench, key=key, roles=roles)) == 1
    assert left(tmp_path, ID) == []
    assert kinds(bench.press(ID, key=KEY)) == [(CLIENT, "press_refused")]


@pytest.fixture
def writer():
    return HeldWriter()


@pytest.fixture
def slow(tmp_path, writer):
    with FolderStore(tmp_path / "data") as store:
        yield Bench(Hub(store, SETTINGS, Settings(), writer=writer), store)


def test_it_is_answered_when_all_is_erased_a_repeat_too(slow, writer, tmp_path):
    done(slow)
    assert withdraw(slow, request=5) == []
    assert withdraw(slow, request=5) == []
    assert len(left(tmp_path, ID)) > 0
    assert len(writer.held) == 1
    writer.go_on()
    assert removed(slow._sent(slow.hub.written(slow.now))) == 1
    assert left(tmp_path, ID) == []


def test_one_key_does_not_keep_others_from_removing(slow, writer):
    slow.sensor()
    for number in range(16):
        assert withdraw(slow, f"mine-{number}") == []
    assert kinds(withdraw(slow, "mine-16")) == [(CLIENT, "request_failed")]
    assert kinds(withdraw(slow, key=ANOTHERS)) == []
    assert len(writer.held) == 17


def test_one_key_does_not_keep_the_hub_busy(bench):
    bench.sensor()
    answers = [kinds(withdraw(bench, f"id-{number}"))[0][1] for number in range(33)]
    assert answers == 32 * ["removed"] + ["request_failed"]
    assert kinds(withdraw(bench, key=ANOTHERS)) == [(CLIENT, "removed")]
    bench.now += 0.5
    assert kinds(withdraw(bench)) == [(CLIENT, "removed")]
    assert {kinds(withdraw(bench, f"id-{number}", key="", roles=frozenset(Role)))[0][1]
            for number in range(40)} == {"removed"}


def test_the_retention_goes_on_while_withdrawals_are_under_way(tmp_path, writer):
    clock = FakeClock()
    with FolderStore(tmp_path / "data", clock) as store:
        bench = Bench(Hub(store, SETTINGS, Settings(), writer=writer), store)
        done(bench)
        bench.wait(0.0)
        while writer.held:
            writer.go_on()
        bench._sent(bench.hub.written(bench.now))
        clock.pass_time(2 * 86400)
        withdraw(bench, "another")
        bench.wait(601)
        assert bench.store.find(ID) is None
        assert len(writer.held) == 2


def test_what_is_remembered_of_withdrawals_is_bounded(bench, monkeypatch):
    monkeypatch.setattr("denseface.service.hub.withdrawn._MAX_WITHDRAWN", 2)
    bench.sensor()
    for capture_id in ("a", "b", "c"):
        withdraw(bench, capture_id)
    assert [kinds(bench.press(one, key=KEY))[0][1] for one in "abc"] == [
        "take", "press_refused", "press_refused"]
