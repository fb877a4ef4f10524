"""Dead letters, retention, purges."""

import itertools

import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore
from tests.unit.service.clocks import FakeClock
from tests.unit.service.hub.bench import (
    CLIENT,
    OTHER,
    SETTINGS,
    WORKER,
    Bench,
    kinds,
    restarted,
)

DAY = 86400.0
OPERATOR = b"operator"
CREDIT = itertools.count(100)


@pytest.fixture
def clock():
    return FakeClock()


@pytest.fixture
def bench(tmp_path, clock):
    with FolderStore(tmp_path / "data", clock) as store:
        yield Bench(Hub(store, SETTINGS, Settings()), store)


@pytest.fixture
def files(tmp_path):
    """Names the files of a capture, wherever they are."""
    return lambda capture_id: sorted(
        path.name for path in (tmp_path / "data").rglob("*")
        if capture_id in path.name.split("."))


def ask(bench, message):
    (answer,) = [one for peer, one in bench.say(OPERATOR, message) if peer == OPERATOR]
    return answer


def dead(bench, capture_id="a"):
    bench.accepted(capture_id)
    for _ in range(SETTINGS.attempts):
        bench.worker(WORKER, next(CREDIT))
        bench.fail_job(capture_id=capture_id)
    assert bench.published[-1].dead


def done(bench, *capture_ids):
    bench.accepted(*capture_ids)
    for capture_id in capture_ids:
        bench.worker(WORKER, next(CREDIT))
        bench.result(capture_id)
        assert bench.published[-1].kind == "face_done"


def after(bench, number):
    return bench.say(CLIENT, messages.GetNext(request=1, after=number))[0][1]


def test_dead_letters_are_listed_by_page(bench, monkeypatch):
    monkeypatch.setattr("denseface.service.hub.maintenance._PAGE", 2)
    for capture_id in "abc":
        dead(bench, capture_id)
    first = ask(bench, messages.ListDead(request=1)).letters
    assert [(one.capture_id, one.sequence, one.attempts, one.error, one.message) for one in first
            ] == [("a", 1, 2, "Error", "why"), ("b", 2, 2, "Error", "why")]
    second = ask(bench, messages.ListDead(request=1, after=first[-1].sequence)).letters
    assert [one.capture_id for one in second] == ["c"]
    assert ask(bench, messages.ListDead(request=1, after=3)).letters == ()


def test_a_retried_dead_letter_has_all_its_attempts_and_another_number(bench):
    dead(bench)
    bench.worker(WORKER, 10**6)
    retry = messages.RetryDead(request=4, capture_id="a")
    sent = bench.say(OPERATOR, retry)
    assert kinds(sent) == [(OPERATOR, "capture_pending"), (WORKER, "job")]
    assert sent[1][1].attempt == 1
    assert ask(bench, retry).kind == "capture_pending"
    assert after(bench, 0).kind == "nothing_newer"
    assert kinds(bench.say(CLIENT, messages.GetFace(request=5, capture_id="a"))) == [
        (CLIENT, "capture_pending")]
    bench.result()
    assert [(one.kind, one.sequence) for one in bench.published] == [
        ("capture_failed", 1), ("face_done", 2)]
    assert after(bench, 0).sequence == 2
    assert ask(bench, retry).message == "capture a is done, no dead letter"


def test_a_dead_letter_without_its_frame_stays_dead(bench, tmp_path):
    dead(bench)
    (tmp_path / "data" / "frames" / "a.frame").write_bytes(b"damaged")
    assert "checksum" in ask(bench, messages.RetryDead(request=1, capture_id="a")).message
    assert bench.store.find("a").state is CaptureState.DEAD
    assert after(bench, 0).dead


def test_a_dropped_dead_letter_is_gone(bench, files):
    dead(bench)
    drop = messages.DropDead(request=1, capture_id="a")
    assert (ask(bench, drop).removed, files("a")) == (1, [])
    assert ask(bench, drop).kind == "capture_unknown"
    assert ask(bench, messages.RetryDead(request=1, capture_id="a")).kind == "capture_unknown"
    assert (after(bench, 0).kind, after(bench, 0).sequence) == ("nothing_newer", 1)


def test_only_dead_letters_are_dropped(bench):
    bench.accepted("a")
    answer = ask(bench, messages.DropDead(request=1, capture_id="a"))
    assert answer.message == "capture a is accepted, no dead letter"


def test_what_is_finished_goes_after_the_retention(bench, clock, files):
    done(bench, "a", "b")
    dead(bench, "c")
    bench.accepted("waits")
    clock.pass_time(DAY - 1)
    bench.wait(601)
    assert after(bench, 0).capture_id == "a"
    clock.pass_time(1)
    bench.wait(601)
    assert (after(bench, 0).kind, after(bench, 0).sequence) == ("nothing_newer", 3)
    assert [files(one) for one in "abc"] == [[], [], []]
    assert bench.store.counts() == {CaptureState.ACCEPTED: 1}
    bench.worker(OTHER)
    bench.result("waits", OTHER)
    assert after(bench, 1).sequence == 4


def test_many_go_in_batches_one_a_tick(bench, clock, monkeypatch):
    monkeypatch.setattr("denseface.service.hub.maintenance._BATCH", 2)
    done(bench, "a", "b", "c")
    clock.pass_time(DAY)
    bench.wait(601)
    assert sum(bench.store.counts().values()) == 1
    bench.wait(0.25)
    assert bench.store.counts() == {}


def test_a_clock_set_forward_removes_nothing_early(bench, clock):
    done(bench, "a")
    clock.set_wall(400 * DAY)
    bench.wait(601)
    assert after(bench, 0).capture_id == "a"
    clock.pass_time(DAY)
    bench.wait(601)
    assert after(bench, 0).kind == "nothing_newer"


def test_a_clock_set_back_keeps_nothing_for_ever(bench, clock):
    done(bench, "a")
    clock.set_wall(-400 * DAY)
    clock.pass_time(DAY)
    bench.wait(601)
    assert after(bench, 0).kind == "nothing_newer"


def test_retention_off_keeps_everything(bench, clock):
    done(bench, "a")
    off = Bench(Hub(bench.store, SETTINGS.model_copy(update={"retention": None}), Settings()),
                bench.store)
    clock.pass_time(1000 * DAY)
    off.wait(601)
    assert after(off, 0).capture_id == "a"


def test_a_purged_capture_is_gone_and_may_be_pressed_again(bench, files):
    done(bench, "a", "b")
    answer = ask(bench, messages.Purge(request=1, capture_id="a"))
    assert (answer.removed, answer.left, files("a")) == (1, False, [])
    assert ask(bench, messages.Purge(request=1, capture_id="a")).removed == 0
    assert kinds(bench.say(CLIENT, messages.GetFace(request=1, capture_id="a"))) == [
        (CLIENT, "capture_unknown")]
    assert after(bench, 0).capture_id == "b"
    done(bench, "a")
    assert after(bench, 2).sequence == 3


def test_the_name_of_a_purged_capture_is_nowhere_in_the_database(bench, tmp_path):
    bench.accepted("MargaretHamilton")
    bench.worker()
    bench.fail_job(capture_id="MargaretHamilton", final=True)
    database = [path for path in (tmp_path / "data").iterdir() if path.is_file()]
    assert any(b"MargaretHamilton" in path.read_bytes() for path in database)
    ask(bench, messages.Purge(request=1, capture_id="MargaretHamilton"))
    assert not any(b"MargaretHamilton" in path.read_bytes() for path in database)


def test_the_late_face_of_a_purged_capture_stays_away(bench):
    bench.accepted("a")
    (job,) = bench.worker()
    assert bench.say(CLIENT, messages.GetFace(request=9, capture_id="a", wait_s=50)) == []
    sent = bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    assert kinds(sent) == [(CLIENT, "capture_unknown"), (OPERATOR, "removed")]
    bench.result(frame_sha256=job[1].frame_sha256)
    assert bench.published == []
    assert bench.store.find("a") is None


def test_the_late_face_of_a_purged_capture_is_not_the_next_one_s(bench, monkeypatch):
    bench.accepted("a")
    (job,) = bench.worker()
    ask(bench, messages.Purge(request=1, capture_id="a"))
    # Any change: the next frame has another checksum.
    monkeypatch.setattr("tests.unit.service.hub.bench.FRAME", job[1].frame.model_copy(
        update={"depth_timestamp_us": 5000, "color_timestamp_us": 6000}))
    bench.accepted("a")
    bench.result(frame_sha256=job[1].frame_sha256)
    assert bench.published == []
    assert kinds(bench.worker(credit=1)) == [(WORKER, "job")]
    bench.result()
    assert [one.kind for one in bench.published] == ["face_done"]


def test_a_purge_refuses_the_press_under_way(bench):
    bench.sensor()
    bench.press()
    sent = bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    assert kinds(sent) == [(CLIENT, "press_refused"), (OPERATOR, "removed")]
    assert kinds(bench.frame())[0][1] == "frame_refused"


def test_all_are_purged_in_batches(bench, monkeypatch, files):
    monkeypatch.setattr("denseface.service.hub.maintenance._BATCH", 2)
    done(bench, "a", "b")
    bench.accepted("c")
    purge = messages.Purge(request=1, everything=True)
    answers = [ask(bench, purge) for _ in range(2)]
    assert [(one.removed, one.left) for one in answers] == [(2, True), (1, False)]
    assert bench.store.counts() == {}
    assert bench.worker(OTHER) == []


def test_who_pressed_is_known_as_long_as_the_capture_is_kept(bench):
    bench.sensor()
    for key in ("0f", "1e"):
        press = Packet(messages.Press(request=1, capture_id="a"))
        bench.hub.receive(bench.now, CLIENT, press, key)
        bench.hub.receive(bench.now, OTHER, press, "2d")
        assert bench.hub.pressed_by("a") is None
        bench.frame()
        bench.hub.receive(bench.now, OTHER, press, "2d")
        assert bench.hub.pressed_by("a") == key
        assert restarted(bench).hub.pressed_by("a") == key
        ask(bench, messages.Purge(request=1, capture_id="a"))
        assert bench.hub.pressed_by("a") is None


def test_what_is_older_than_a_time_is_purged(bench, clock):
    done(bench, "a")
    clock.pass_time(60)
    moment = clock.wall()
    done(bench, "b")
    assert ask(bench, messages.Purge(request=1, before=moment)).removed == 1
    assert after(bench, 0).capture_id == "b"


def test_a_file_that_resists_is_removed_later(bench, monkeypatch, files):
    def resists(path, missing_ok=False):
        raise OSError(5, "Input/output error")

    done(bench, "a")
    monkeypatch.setattr("pathlib.Path.unlink", resists)
    answer = ask(bench, messages.Purge(request=1, capture_id="a"))
    assert "the disk fails" in answer.message
    monkeypatch.undo()
    assert bench.store.find("a") is None
    assert after(bench, 0).kind == "nothing_newer"
    assert len(files("a")) == 2
    bench.wait(601)
    assert files("a") == []


def test_a_damaged_face_is_made_again(bench, tmp_path):
    done(bench, "a", "b")
    (face,) = (tmp_path / "data" / "faces").glob("a.*")
    face.write_bytes(face.read_bytes()[:-1])
    assert after(bench, 0).capture_id == "b"
    assert kinds(bench.worker(OTHER)) == [(OTHER, "job")]
    bench.result("a", OTHER)
    assert [(one.capture_id, one.sequence) for one in bench.published] == [
        ("a", 1), ("b", 2), ("a", 3)]
    assert after(bench, 2).capture_id == "a"
    assert len(list((tmp_path / "data" / "quarantine").glob("*.face"))) == 1


def test_a_face_that_is_lost_with_its_frame_is_a_dead_letter(bench, tmp_path):
    done(bench, "a")
    for path in (tmp_path / "data").rglob("a.*"):
        path.unlink()
    assert kinds(bench.say(CLIENT, messages.GetFace(request=1, capture_id="a"))) == [
        (CLIENT, "capture_pending")]
    assert bench.worker(OTHER) == []
    assert (bench.published[-1].dead, bench.published[-1].error) == (True, "CorruptFileError")
    assert after(bench, 1).dead


def test_a_late_joiner_finds_its_start(bench, clock):
    done(bench, "a", "b")
    clock.pass_time(60)
    moment = clock.wall()
    done(bench, "c")

    def start(**what):
        answer = bench.say(CLIENT, messages.FindStart(request=3, **what))[0][1]
        assert (answer.epoch, answer.request) == (bench.store.epoch, 3)
        return answer.sequence

    assert [start(last=count) for count in (1, 2, 9)] == [2, 1, 0]
    assert start(since=moment) == 2
    clock.pass_time(60)
    assert start(since=clock.wall()) == 3
    ask(bench, messages.Purge(request=1, capture_id="b"))
    assert start(last=2) == 0
    ask(bench, messages.Purge(request=1, everything=True))
    assert (start(last=1), start(since=moment)) == (3, 3)
