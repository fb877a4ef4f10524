"""The hub on a disk that is full or fails."""

import errno
import os
import sqlite3
from pathlib import Path

from denseface.recon.settings import Settings
from denseface.service.errors import DiskFullError, StoreError
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from tests.unit.service.hub.bench import CLIENT, OTHER, SENSOR, SETTINGS, WORKER, Bench, kinds


def test_a_store_that_fails_answers_the_request(bench, monkeypatch):
    def broken(_):
        raise StoreError("disk on fire")

    monkeypatch.setattr(bench.store, "outcome", broken)
    (answer,) = bench.say(CLIENT, messages.GetFace(request=3, capture_id="a"))
    assert (answer[1].kind, answer[1].message) == ("request_failed", "disk on fire")


def test_a_result_waits_for_room(bench, monkeypatch):
    def full(*_):
        raise StoreError("No space left on device")

    bench.accepted("a", "b")
    bench.worker()
    monkeypatch.setattr(bench.store, "finish", full)
    bench.result()
    assert bench.worker(credit=1) == []
    assert bench.wait(1.1) == []
    assert bench.published == []
    monkeypatch.undo()
    assert kinds(bench.wait(1.1)) == [(WORKER, "job")]
    (published,) = bench.published
    assert (published.kind, published.capture_id) == ("face_done", "a")
    assert bench.store.find("a").attempts == 1


def test_a_failure_that_cannot_be_kept_is_told_again(bench, monkeypatch):
    def full(*_):
        raise StoreError("No space left on device")

    bench.accepted("a")
    bench.worker()
    monkeypatch.setattr(bench.store, "fail", full)
    bench.fail_job(final=True)
    monkeypatch.undo()
    assert kinds(bench.worker(credit=1)) == [(WORKER, "job")]
    bench.fail_job(final=True)
    assert [message.kind for message in bench.published] == ["capture_failed"]


def test_a_disk_that_is_nearly_full_refuses_the_press(bench):
    full = Bench(Hub(bench.store, SETTINGS.model_copy(update={"reserve_mib": 2**30}), Settings()),
                 bench.store)
    full.sensor()
    (answer,) = full.press()
    assert answer[1].kind == "press_refused"
    assert "no room on the disk" in answer[1].message


def test_a_disk_that_does_not_answer_refuses_the_press(bench, monkeypatch):
    def fails():
        raise StoreError("the disk fails")

    monkeypatch.setattr(bench.store, "free_bytes", fails)
    bench.sensor()
    assert bench.press()[0][1].message == "the disk fails"


def test_a_disk_that_damages_every_face_uses_up_the_attempts(bench, monkeypatch):
    real = bench.store.finish

    def damaging(*arguments):
        real(*arguments)
        for path in bench.store._layout.faces.iterdir():
            path.write_bytes(b"damaged")

    monkeypatch.setattr(bench.store, "finish", damaging)
    bench.accepted("a")
    for credit in range(SETTINGS.attempts):
        assert kinds(bench.worker(credit=credit)) == [(WORKER, "job")]
        bench.result()  # published from memory
        assert bench.published[-1].kind == "face_done"
        bench.say(CLIENT, messages.GetNext(request=1, after=0))  # read from the disk
    assert len(bench.published) == SETTINGS.attempts + 1
    assert (bench.published[-1].dead, bench.published[-1].error) == (True, "CorruptFileError")


def test_a_face_that_was_read_once_and_then_damaged_has_all_attempts_again(bench):
    bench.accepted("a")
    bench.worker()
    bench.result()
    ask = messages.GetNext(request=1, after=0)
    assert [one.kind for _, one in bench.say(CLIENT, ask)] == ["face_done"]
    for path in bench.store._layout.faces.iterdir():
        path.write_bytes(b"damaged")
    bench.say(CLIENT, ask)
    assert bench.store.find("a").attempts == 0


class _FailingDatabase:
    """A connection whose commits fail after all was written, while `fails`; SQLite rolls back."""

    def __init__(self, connection):
        self._connection = connection
        self.fails = True

    def __getattr__(self, name):
        return getattr(self._connection, name)

    def execute(self, statement, *values):
        if statement == "COMMIT" and self.fails:
            error = sqlite3.OperationalError("disk I/O error")
            error.sqlite_errorcode = sqlite3.SQLITE_IOERR_FSYNC
            raise error
        return self._connection.execute(statement, *values)


def test_nothing_is_refused_while_a_later_hub_might_find_it_accepted(bench, monkeypatch):
    database = _FailingDatabase(bench.store._database._connection)
    monkeypatch.setattr(bench.store._database, "_connection", database)
    bench.sensor()
    bench.press("a")
    assert bench.frame("a") == []
    assert bench.wait(0.1) == []
    # Others have an answer at once: of them nothing was written.
    ((peer, refused),) = bench.press("b", request=8, peer=OTHER)
    assert (peer, refused.kind, refused.reason) == (OTHER, "press_refused", "disk")
    ((_, failed),) = bench.say(OTHER, messages.Purge(request=9, capture_id="a"))
    assert failed.kind == "request_failed"
    assert bench.store._layout.unnamed_frame("a").exists()
    database.fails = False
    assert kinds(bench.wait(0.1)) == [(SENSOR, "frame_refused"), (CLIENT, "press_refused")]
    assert not bench.store._layout.unnamed_frame("a").exists()
    assert bench.store.find("a") is None
    assert kinds(bench.press("a", request=10)) == [(SENSOR, "take")]
    assert kinds(bench.frame("a")) == [(SENSOR, "frame_accepted"), (CLIENT, "press_accepted")]


def test_what_was_refused_and_cannot_be_removed_is_removed_later(bench, monkeypatch):
    unlink = Path.unlink

    def fails(path, *arguments, **named):
        if path.suffix == ".pending" and path.exists():
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        unlink(path, *arguments, **named)

    def full(*_):
        raise DiskFullError("no room on the disk")

    bench.sensor()
    with monkeypatch.context() as patch:
        patch.setattr(bench.store, "accept", full)
        patch.setattr(Path, "unlink", fails)
        for name in ("a", "b"):
            bench.press(name)
            assert (CLIENT, "press_refused") in kinds(bench.frame(name))
        ((_, failed),) = bench.say(OTHER, messages.Purge(request=9, capture_id="a"))
        assert failed.kind == "request_failed"
    frames = bench.store._layout.frames
    assert sorted(path.name for path in frames.iterdir()) == ["a.pending", "b.pending"]
    bench.press("a", request=10)  # anew: nothing removes it any more
    assert (CLIENT, "press_accepted") in kinds(bench.frame("a"))
    bench.wait(700)  # longer than between two sweeps
    assert [path.name for path in frames.iterdir()] == ["a.frame"]
    bench.store.frame("a")
