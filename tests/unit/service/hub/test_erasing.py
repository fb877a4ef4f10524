"""What is removed is erased beside the loop, and said to be removed when nothing of it is left."""

import sqlite3
import threading
from contextlib import closing

import pytest

from denseface.recon.settings import Settings
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore, InlineWriter, WriterThreads
from tests.unit.service.hub.bench import CLIENT, SENSOR, SETTINGS, WORKER, Bench, kinds
from tests.waiting import LIMIT_S, until

OPERATOR, ANOTHER = b"operator", b"another"


class HeldWriter(InlineWriter):
    """Erases when it is told to."""

    def __init__(self):
        super().__init__()
        self.held = []

    def erase(self, pending):
        self.held.append(pending)

    def go_on(self):
        super().erase(self.held.pop(0))


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


@pytest.fixture
def writer():
    return HeldWriter()


@pytest.fixture
def bench(data, writer):
    with FolderStore(data) as store:
        yield Bench(Hub(store, SETTINGS, Settings(), writer=writer), store)


def go_on(bench, writer):
    """One erasure ends, and the hub hears of it."""
    writer.go_on()
    return bench._sent(bench.hub.written(bench.now))


def files(data):
    return sorted(path.name for folder in ("frames", "faces", "quarantine")
                  for path in (data / folder).iterdir())


def done(bench, *capture_ids):
    bench.accepted(*capture_ids)
    for number, capture_id in enumerate(capture_ids):
        bench.worker(WORKER, number)
        bench.result(capture_id)


def named(data, word):
    return [path.name for path in data.iterdir()
            if path.is_file() and word.encode() in path.read_bytes()]


def test_the_hub_goes_on_while_it_erases(bench, writer, data):
    done(bench, "a", "b")
    purge = messages.Purge(request=1, everything=True)
    assert bench.say(OPERATOR, purge) == []
    assert bench.say(OPERATOR, purge) == []
    assert len(writer.held) == 1
    assert kinds(bench.say(CLIENT, messages.GetFace(request=1, capture_id="a"))) == [
        (CLIENT, "capture_unknown")]
    bench.accepted("c")
    assert len(files(data)) == 5
    ((peer, removed),) = go_on(bench, writer)
    assert (peer, removed.removed, removed.left) == (OPERATOR, 2, False)
    assert files(data) == ["c.frame"]
    assert bench.store.find("c").state is CaptureState.ACCEPTED


def test_an_id_is_not_used_again_before_its_files_are_gone(bench, writer, data):
    done(bench, "a")
    bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    assert bench.press("a") == []
    assert bench.press("a") == []
    go_on(bench, writer)
    assert kinds(bench.press("a")) == [(SENSOR, "take")]
    bench.frame("a")
    assert files(data) == ["a.frame"]


def test_two_operators_purge_the_same_and_it_is_pressed_between(bench, writer, data):
    done(bench, "a")
    bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    bench.say(ANOTHER, messages.Purge(request=1, capture_id="a"))
    ((peer, removed),) = go_on(bench, writer)
    assert (peer, removed.removed) == (OPERATOR, 1)
    bench.press("a")
    bench.frame("a")
    ((peer, removed),) = go_on(bench, writer)
    assert (peer, removed.removed) == (ANOTHER, 0)
    assert bench.store.find("a").state is CaptureState.ACCEPTED
    assert files(data) == ["a.frame"]


def test_what_another_purge_could_not_erase_is_not_said_to_be_removed(bench, writer, monkeypatch):
    def resists(path):
        raise OSError(5, "Input/output error")

    done(bench, "a")
    bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    bench.say(ANOTHER, messages.Purge(request=1, capture_id="a"))
    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.unlink", resists)
        assert "the disk fails" in go_on(bench, writer)[0][1].message
    assert "could not be erased yet" in go_on(bench, writer)[0][1].message
    bench.say(ANOTHER, messages.Purge(request=2, capture_id="a"))
    assert kinds(go_on(bench, writer)) == [(ANOTHER, "removed")]


def test_a_purge_of_all_takes_what_a_purge_before_could_not_erase(
        bench, writer, data, monkeypatch):
    def resists(path):
        raise OSError(5, "Input/output error")

    done(bench, "a")
    bench.say(OPERATOR, messages.Purge(request=1, capture_id="a"))
    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.unlink", resists)
        assert kinds(go_on(bench, writer)) == [(OPERATOR, "request_failed")]
    assert len(files(data)) == 2
    bench.say(OPERATOR, messages.Purge(request=2, everything=True))
    assert kinds(go_on(bench, writer)) == [(OPERATOR, "removed")]
    assert files(data) == []


def test_a_dropped_dead_letter_is_not_unknown_to_a_repeat(bench, writer):
    bench.accepted("a")
    for number in range(SETTINGS.attempts):
        bench.worker(WORKER, number)
        bench.fail_job()
    drop = messages.DropDead(request=1, capture_id="a")
    assert bench.say(OPERATOR, drop) == bench.say(OPERATOR, drop) == []
    assert kinds(go_on(bench, writer)) == [(OPERATOR, "removed")]
    assert kinds(bench.say(OPERATOR, drop)) == [(OPERATOR, "capture_unknown")]


@pytest.mark.parametrize("purge", [
    messages.Purge(request=1, capture_id="a"), messages.Purge(request=1, everything=True)])
def test_files_without_a_row_are_purged_too(bench, writer, data, purge):
    done(bench, "a")
    with closing(sqlite3.connect(data / "captures.sqlite3")) as other, other:
        other.execute("DELETE FROM outcomes")
        other.execute("DELETE FROM captures")
    assert len(files(data)) == 2
    bench.say(OPERATOR, purge)
    ((_, removed),) = go_on(bench, writer)
    assert (removed.removed, removed.left) == (1, False)
    assert files(data) == []


def reader(data):
    """Another program that reads the database and does not end its transaction."""
    other = sqlite3.connect(data / "captures.sqlite3")
    other.execute("BEGIN")
    other.execute("SELECT * FROM captures").fetchone()
    return other


def test_nothing_is_said_to_be_removed_while_the_log_names_it(bench, writer, data):
    done(bench, "MargaretHamilton")
    with closing(reader(data)):
        bench.say(OPERATOR, messages.Purge(request=1, capture_id="MargaretHamilton"))
        assert go_on(bench, writer) == []
        assert files(data) == []
        assert named(data, "MargaretHamilton")
        assert bench.wait(1) == []
        assert go_on(bench, writer) == []
        ((_, failed),) = bench.wait(5)
        assert "another program has the database open" in failed.message
        go_on(bench, writer)
    bench.say(OPERATOR, messages.Purge(request=2, capture_id="MargaretHamilton"))
    assert kinds(go_on(bench, writer)) == [(OPERATOR, "removed")]
    assert named(data, "MargaretHamilton") == []


def test_the_log_is_tried_again_until_it_is_empty(bench, writer, data):
    done(bench, "MargaretHamilton")
    with closing(reader(data)):
        bench.say(OPERATOR, messages.Purge(request=1, capture_id="MargaretHamilton"))
        assert go_on(bench, writer) == []
    bench.wait(1)
    assert kinds(go_on(bench, writer)) == [(OPERATOR, "removed")]
    assert named(data, "MargaretHamilton") == []
    bench.wait(1)
    assert writer.held == []


def test_a_log_that_could_not_be_emptied_is_emptied_by_the_next_hub(data):
    with FolderStore(data) as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        bench.accepted("MargaretHamilton")
        other = reader(data)
        assert bench.say(OPERATOR, messages.Purge(request=1, capture_id="MargaretHamilton")) == []
    assert named(data, "MargaretHamilton")
    with FolderStore(data) as store:
        bench = Bench(Hub(store, SETTINGS, Settings()), store)
        bench.wait(1)
        assert named(data, "MargaretHamilton")
        other.close()
        bench.wait(1)
        assert named(data, "MargaretHamilton") == []


def test_a_thread_erases(data):
    with FolderStore(data) as store, WriterThreads() as writer:
        bench = Bench(Hub(store, SETTINGS, Settings(), writer=writer), store)
        bench.accepted("a")
        bench._sent(bench.hub.written(bench.now, wait=True))
        free = threading.Event()
        erase = store.retention._eraser._erase

        def slowly(erasure):
            assert threading.current_thread() is not threading.main_thread()
            assert free.wait(LIMIT_S)
            return erase(erasure)

        store.retention._eraser._erase = slowly
        assert bench.say(OPERATOR, messages.Purge(request=1, everything=True)) == []
        assert kinds(bench.say(CLIENT, messages.GetStatus(request=1))) == [(CLIENT, "status")]
        assert not writer.has_results()
        free.set()
        until(writer.has_results)
        assert kinds(bench._sent(bench.hub.written(bench.now))) == [(OPERATOR, "removed")]


def test_a_stop_in_order_finishes_what_is_being_erased(data):
    with FolderStore(data) as store, WriterThreads() as writer:
        bench = Bench(Hub(store, SETTINGS, Settings(), writer=writer), store)
        bench.accepted("a")
        bench._sent(bench.hub.written(bench.now, wait=True))
        bench.say(OPERATOR, messages.Purge(request=1, everything=True))
        assert kinds(bench._sent(bench.hub.written(bench.now, wait=True))) == [
            (OPERATOR, "removed")]
