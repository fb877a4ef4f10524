"""Files are written in threads, synced together, and each failure is told of its own file."""

import os
import select
import stat
import threading

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import DiskFullError
from denseface.service.storage.folder_store import FolderStore
from denseface.service.storage.writer import WriterThreads, write
from tests.unit.service.keep import accept
from tests.unit.service.storage.test_folder_store import frame, result


@pytest.fixture
def store(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield store


def draft(store, capture_id):
    return store.frame_draft(frame(capture_id), Settings(), "0f")


def synced(monkeypatch):
    """Note what is synced: files and folders."""
    steps, sync = [], os.fsync

    def note(descriptor):
        steps.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        sync(descriptor)

    monkeypatch.setattr("denseface.service.storage.record_file.os.fsync", note)
    return steps


def readable(writer):
    return bool(select.select([writer], [], [], 0)[0])


def test_files_that_wait_together_share_the_sync_of_their_folder(store, monkeypatch):
    accept(store, frame("z"), Settings(), "0f")
    drafts = [draft(store, "a"), store.face_draft(result("z", store)), draft(store, "b")]
    steps = synced(monkeypatch)
    written = write(drafts)
    assert steps == ["file", "file", "file", "folder", "folder"]
    assert [one.draft for one in written] == drafts
    assert all(one.checksum and one.error is None for one in written)


def test_one_that_fails_takes_none_with_it(store, monkeypatch):
    drafts = [draft(store, name) for name in "abc"]
    replace = type(drafts[0].path).replace

    def full(path, target):
        if target.name == "b.frame":
            raise OSError(28, "No space left on device")
        return replace(path, target)

    monkeypatch.setattr("pathlib.Path.replace", full)
    written = write(drafts)
    assert [type(one.error) for one in written] == [type(None), DiskFullError, type(None)]
    assert sorted(path.name for path in store._layout.frames.iterdir()) == ["a.frame", "c.frame"]


def test_a_folder_that_cannot_be_synced_fails_all_of_it(store, monkeypatch):
    drafts = [draft(store, name) for name in "ab"]
    fsync = os.fsync

    def no_folder(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(28, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr("denseface.service.storage.record_file.os.fsync", no_folder)
    assert [type(one.error) for one in write(drafts)] == [DiskFullError, DiskFullError]
    assert not list(store._layout.frames.iterdir())


def test_frames_do_not_wait_for_a_face_and_each_kind_stays_in_order(store, monkeypatch):
    go, waits = threading.Event(), threading.Event()
    accept(store, frame("z"), Settings(), "0f")
    face = store.face_draft(result("z", store))
    real = type(face).write

    def slow_for_faces(self):
        if self is face:
            waits.set()
            assert go.wait(20)
        return real(self)

    monkeypatch.setattr(type(face), "write", slow_for_faces)
    with WriterThreads() as writer:
        writer.start(face)
        assert waits.wait(20)
        frames = [draft(store, name) for name in "abc"]
        for one in frames:
            writer.start(one)
        done = []
        while len(done) < len(frames):
            assert select.select([writer], [], [], 20)[0]
            assert writer.any_ended()
            done += writer.take()
        assert [one.draft for one in done] == frames
        assert not writer.any_ended()
        assert not readable(writer)
        go.set()
        writer.settle()
        assert writer.any_ended()
        assert readable(writer)
        assert [one.draft for one in writer.take()] == [face]
        assert not writer.any_ended()
        assert not readable(writer)


def test_at_the_end_what_was_begun_is_written(store):
    drafts = [draft(store, f"c{number}") for number in range(20)]
    with WriterThreads() as writer:
        for one in drafts:
            writer.start(one)
    assert [one.draft for one in writer.take()] == drafts
    assert all(one.path.exists() for one in drafts)


def test_what_nobody_expected_is_told_too(store, monkeypatch):
    def broken(_):
        raise RuntimeError("a mistake")

    one = draft(store, "a")
    monkeypatch.setattr(type(one), "write", broken)
    with WriterThreads() as writer:
        writer.start(one)
        writer.settle()
    assert isinstance(writer.take()[0].error, RuntimeError)
