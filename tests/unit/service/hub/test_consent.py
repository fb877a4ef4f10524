"""What a person agreed to stays with the capture, and what was promised is kept."""

import sqlite3
from contextlib import closing
from datetime import UTC, datetime

import pytest

from denseface.recon.face import Consent
from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore
from tests.unit.service.clocks import FakeClock
from tests.unit.service.hub.bench import CLIENT, FACE, SETTINGS, WORKER, Bench

HOUR, DAY = 3600.0, 86400.0
CONSENT = Consent(text_version="Einwilligung 3", language="de-CH", retention_s=HOUR,
                  at=datetime(2026, 1, 31, 11, 59, 58, 250_001, tzinfo=UTC))
ENDLESS = CONSENT.model_copy(update={"retention_s": None})


@pytest.fixture
def clock():
    return FakeClock()


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


@pytest.fixture
def bench(data, clock):
    with FolderStore(data, clock) as store:
        yield Bench(Hub(store, SETTINGS, Settings()), store)


def pressed(bench, capture_id="a", consent=CONSENT):
    bench.sensor()
    bench.say(CLIENT, messages.Press(request=7, capture_id=capture_id, consent=consent))


def accepted(bench, *arguments):
    pressed(bench, *arguments)
    bench.frame(*arguments[:1])


def done(bench, *arguments):
    accepted(bench, *arguments)
    bench.worker(WORKER, int(bench.now))
    bench.now += 1
    bench.result(*arguments[:1])


def told(bench, capture_id="a"):
    ((_, answer),) = bench.say(CLIENT, messages.GetFace(request=1, capture_id=capture_id))
    return answer.face.report.consent


def files(data):
    return sorted(path.name for folder in ("frames", "faces") for path in (data / folder).iterdir())


def rows(data):
    with closing(sqlite3.connect(data / "captures.sqlite3")) as database:
        return database.execute("SELECT capture_id FROM consents").fetchall()


@pytest.mark.parametrize("consent", [CONSENT, ENDLESS])
def test_it_is_told_with_the_face_as_it_was_given(bench, consent):
    done(bench, "a", consent)
    assert told(bench) == consent
    assert bench.published[-1].face.report.consent == consent


def test_that_of_the_first_press_stands(bench):
    pressed(bench)
    bench.say(CLIENT, messages.Press(request=8, capture_id="a"))
    bench.frame()
    bench.worker()
    bench.result()
    assert told(bench) == CONSENT


def test_a_worker_can_neither_make_one_nor_take_one_away(bench):
    done(bench, "a", None)
    assert told(bench) is None
    accepted(bench, "b", CONSENT)
    bench.worker(WORKER, 10**6)
    claimed = FACE.report.model_copy(update={"consent": ENDLESS})
    stored = bench.store.find("b")
    bench.say(WORKER, messages.Result(
        capture_id="b", settings_hash=stored.settings_hash, frame_sha256=stored.frame_sha256,
        face=FACE.model_copy(update={"report": claimed})), dict(bench.store._outcome(
            "capture_id = ?", "a").arrays))
    assert told(bench, "b") == CONSENT


@pytest.mark.parametrize("lost", ["captures.sqlite3", "captures.sqlite3 and frames"])
def test_it_and_who_pressed_survive_the_loss_of_the_database(data, clock, lost):
    with FolderStore(data, clock) as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        bench.sensor()
        bench.say(CLIENT, messages.Press(request=7, capture_id="a", consent=CONSENT), key="0f")
        bench.frame()
        bench.worker()
        bench.result()
    (data / "captures.sqlite3").unlink()
    if "frames" in lost:
        (data / "frames" / "a.frame").unlink()
    with FolderStore(data, clock) as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        assert told(bench) == CONSENT
        assert store.find("a").pressed_by == "0f"
        clock.pass_time(HOUR + 0.01)
        bench.wait(1.1)
        assert files(data) == []


def test_what_is_removed_takes_it_along(bench, data):
    done(bench)
    assert rows(data) == [("a",)]
    bench.say(CLIENT, messages.Withdraw(request=1, capture_id="a"))
    assert rows(data) == []
    for path in data.rglob("*"):
        if path.is_file():
            assert b"Einwilligung" not in path.read_bytes(), path.name


@pytest.mark.parametrize("reach", [accepted, done])
def test_a_promise_is_kept_though_the_hub_keeps_others_for_longer(bench, clock, data, reach):
    done(bench, "without", None)
    reach(bench)
    clock.pass_time(HOUR - 1)
    bench.wait(1.1)
    assert bench.store.find("a")
    clock.pass_time(1.01)
    bench.wait(1.1)
    assert bench.store.find("a") is None
    assert files(data) == [f"without.{bench.store.find('without').settings_hash}.face",
                           "without.frame"]
    assert bench.hub._status.make().queued == 0


def test_a_promise_outlives_a_later_setting_and_a_shorter_setting_wins(data, clock):
    with FolderStore(data, clock) as store:
        done(Bench(Hub(store, SETTINGS, Settings()), store))
        for_ever = ServiceSettings(address="ipc:///unused", retention="off", reserve_mib=0)
        bench = Bench(Hub(store, for_ever, Settings()), store)
        clock.pass_time(HOUR + 0.01)
        bench.wait(1.1)
        assert files(data) == []
        short = ServiceSettings(address="ipc:///unused", retention=60, reserve_mib=0)
        bench = Bench(Hub(store, short, Settings()), store, now=1000.0)
        done(bench, "b")
        clock.pass_time(61)
        bench.wait(601)
        assert files(data) == []


def test_a_face_that_is_being_made_when_its_time_is_over_is_dropped(bench, clock, data):
    accepted(bench)
    bench.worker()
    checksum = bench.checksum("a")
    clock.pass_time(HOUR + 0.01)
    bench.wait(1.1)
    assert bench.result("a", frame_sha256=checksum) == []
    assert (bench.published, files(data)) == ([], [])


def test_a_clock_that_is_set_forward_removes_nothing_early(bench, clock):
    done(bench)
    clock.set_wall(DAY)
    bench.wait(1.1)
    assert bench.store.find("a").state is CaptureState.DONE


def test_a_database_of_the_version_before_is_kept(data, clock):
    with FolderStore(data, clock) as store:
        done(Bench(Hub(store, SETTINGS, Settings()), store), "a", None)
        epoch = store.epoch
    with closing(sqlite3.connect(data / "captures.sqlite3")) as database:
        database.executescript("DROP TABLE consents; PRAGMA user_version = 3")
    with FolderStore(data, clock) as store:
        assert store.epoch == epoch
        assert told(Bench(Hub(store, SETTINGS, Settings()), store)) is None
        done(Bench(Hub(store, SETTINGS, Settings()), store), "b")
        assert rows(data) == [("b",)]
