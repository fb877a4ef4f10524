"""Files are written in threads, synced together, and each failure is told of its own file."""

import os
import select
import stat
import threading

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import DiskFullError
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore, WriterThreads, write
from tests.unit.service.storage.test_folder_store import frame, result
from tests.unit.service.storing import accept
from tests.waiting import LIMIT_S


@pytest.fixture
def store(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield store


def pending(store, capture_id):
    return store.prepare_frame(frame(capture_id), Settings(), "0f")


def synced(monkeypatch):
    """Note what is synced: files and folders."""
    steps, sync = [], os.fsync

    def note(descriptor):
        steps.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        sync(descriptor)

    monkeypatch.setattr("denseface.service.runtime.files.os.fsync", note)
    return steps


def readable(writer):
    return bool(select.select([writer], [], [], 0)[0])


def test_files_that_wait_together_share_the_sync_of_their_folder(store, monkeypatch):
    accept(store, frame("z"), Settings(), "0f")
    pending_writes = [
        pending(store, "a"), store.prepare_face(result("z", store)), pending(store, "b")]
    steps = synced(monkeypatch)
    written = write(pending_writes)
    assert steps == ["file", "file", "file", "folder", "folder"]
    assert [one.pending for one in written] == pending_writes
    assert all(one.checksum and one.error is None for one in written)


def test_one_that_fails_takes_none_with_it(store, monkeypatch):
    pending_writes = [pending(store, name) for name in "abc"]
    sync, synced = os.fsync, []

    def full(descriptor):
        synced.append(descriptor)
        if len(synced) == 2:
            raise OSError(28, "No space left on device")
        sync(descriptor)

    monkeypatch.setattr("denseface.service.runtime.files.os.fsync", full)
    written = write(pending_writes)
    assert [type(one.error) for one in written] == [type(None), DiskFullError, type(None)]
    assert sorted(path.name for path in store._layout.frames.iterdir()) == [
        "a.pending", "c.pending"]


def test_a_folder_that_cannot_be_synced_fails_all_of_it(store, monkeypatch):
    pending_writes = [pending(store, name) for name in "ab"]
    fsync = os.fsync

    def no_folder(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(28, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr("denseface.service.runtime.files.os.fsync", no_folder)
    assert [type(one.error) for one in write(pending_writes)] == [DiskFullError, DiskFullError]
    store.refuse(pending_writes)
    assert not list(store._layout.frames.iterdir())


def test_frames_do_not_wait_for_a_face_and_each_kind_stays_in_order(store, monkeypatch):
    go, waits = threading.Event(), threading.Event()
    accept(store, frame("z"), Settings(), "0f")
    face = store.prepare_face(result("z", store))
    real = type(face).write

    def slow_for_faces(self):
        if self is face:
            waits.set()
            assert go.wait(LIMIT_S)
        return real(self)

    monkeypatch.setattr(type(face), "write", slow_for_faces)
    with WriterThreads() as writer:
        writer.start(face)
        assert waits.wait(LIMIT_S)
        frames = [pending(store, name) for name in "abc"]
        for one in frames:
            writer.start(one)
        done = []
        while len(done) < len(frames):
            assert select.select([writer], [], [], LIMIT_S)[0]
            assert writer.has_results()
            done += writer.take_results()
        assert [one.pending for one in done] == frames
        assert not writer.has_results()
        assert not readable(writer)
        assert not writer.wait(timeout_s=0.01)
        go.set()
        assert writer.wait(timeout_s=LIMIT_S)
        assert writer.has_results()
        assert readable(writer)
        assert [one.pending for one in writer.take_results()] == [face]
        assert not writer.has_results()
        assert not readable(writer)


def test_at_the_end_what_was_begun_is_written(store):
    pending_writes = [pending(store, f"c{number}") for number in range(20)]
    with WriterThreads() as writer:
        for one in pending_writes:
            writer.start(one)
    assert [one.pending for one in writer.take_results()] == pending_writes
    assert all(one.unnamed.exists() for one in pending_writes)


def test_what_nobody_expected_is_told_too(store, monkeypatch):
    def broken(_):
        raise RuntimeError("a mistake")

    one = pending(store, "a")
    monkeypatch.setattr(type(one), "write", broken)
    with WriterThreads() as writer:
        writer.start(one)
        writer.wait()
    assert isinstance(writer.take_results()[0].error, RuntimeError)


def test_what_an_earlier_write_left_is_in_no_later_one_s_way(store):
    accept(store, frame("z"), Settings(), "0f")
    for one in (pending(store, "a"), store.prepare_face(result("z", store))):
        one.unnamed.write_bytes(b"left by a disk that failed")
        (written,) = write([one])
        assert written.error is None


def test_a_purge_takes_what_a_write_left(store):
    accept(store, frame("z"), Settings(), "0f")
    left = store.prepare_face(result("z", store)).unnamed
    left.write_bytes(b"half a face")
    store.retention.remove(["z"], CaptureState.REMOVED)
    store.retention.erase(["z"])
    assert not left.exists()
