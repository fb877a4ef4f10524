"""A data folder to which something happened."""

import json
import os
import shutil
import sqlite3
from collections import Counter
from pathlib import Path

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import (
    CorruptFileError,
    DamagedDatabaseError,
    DamagedFaceError,
    DiskFullError,
    StoreError,
)
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from denseface.service.storage._recovery import Progress
from tests.unit.service.clocks import FakeClock
from tests.unit.service.storage.test_folder_store import frame, result
from tests.unit.service.storing import accept, finish

DAY = 86400.0


def states(store):
    return {name: store.find(name) and store.find(name).state
            for name in ("done", "failed", "dead", "waits")}


def reports(data):
    return [json.loads(path.read_text()) for path in (data / "quarantine").glob("*.json")]


REBUILT = {"done": CaptureState.DONE, "failed": CaptureState.ACCEPTED,
           "dead": CaptureState.ACCEPTED, "waits": CaptureState.ACCEPTED}


@pytest.mark.parametrize("damage", [
    lambda _: b"no database " * 500,
    lambda content: content[:len(content) // 2],
    lambda content: content[:4096 * 2] + b"\xff" * 4096 + content[4096 * 3:],
    lambda content: content.replace(b"accepted0f", b"acceptee0f"),
    lambda content: content.replace(b"waits", b"wbits", 1),
    lambda content: content[:60] + b"\0\0\0\1" + content[64:],
    lambda content: content.replace(b'"seconds"', b'"sekonds"'),
])
def test_a_damaged_database_is_made_again_from_the_files(data, damage):
    path = data / "captures.sqlite3"
    with FolderStore(data) as store:
        epoch = store.epoch
    content = path.read_bytes()
    damaged = damage(content)
    assert damaged != content
    path.write_bytes(damaged)
    with FolderStore(data, FakeClock()) as store:
        assert states(store) == REBUILT
        assert store.epoch != epoch
        assert store.outcome_after(0).message.capture_id == "done"
        assert store.last_sequence() == 1
        assert sorted(store.unfinished()) == ["dead", "failed", "waits"]
        assert "settings" in json.loads(store.frame("waits").metadata.model_dump_json())
    (report,) = reports(data)
    assert report["file"].endswith("captures.sqlite3")
    assert next((data / "quarantine").glob("*.captures.sqlite3")).read_bytes() == damaged


@pytest.mark.parametrize("gone", [True, False])
def test_a_database_that_is_gone_is_made_again(data, gone):
    if gone:
        (data / "captures.sqlite3").unlink()
    else:
        (data / "captures.sqlite3").write_bytes(b"")
    with FolderStore(data) as store:
        assert states(store) == REBUILT


def test_a_database_with_a_flipped_bit_is_read_or_made_again(data):
    path = data / "captures.sqlite3"
    content = path.read_bytes()
    for position in range(0, len(content), 211):
        flipped = bytearray(content)
        flipped[position] ^= 1 << position % 8
        path.write_bytes(flipped)
        with FolderStore(data, FakeClock()) as store:
            found = states(store)
            assert found["done"] is CaptureState.DONE
            assert found["waits"] is CaptureState.ACCEPTED
            assert len(store.counts()) in (2, 4)
            store.frame("waits")
        path.write_bytes(content)


def test_a_log_with_a_flipped_bit_loses_nothing_that_was_accepted(data, tmp_path):
    killed = tmp_path / "killed"
    with FolderStore(data, FakeClock()) as store:
        last = store.last_sequence()
        for name in ("x", "y"):
            accept(store, frame(name), Settings(), "0f")
        finish(store, result("x", store))
        shutil.copytree(data, killed)
    log = killed / "captures.sqlite3-wal"
    size = log.stat().st_size
    assert size > 10_000
    for position in range(0, size, 997):
        again = tmp_path / str(position)
        shutil.copytree(killed, again)
        _flip(again / log.name, position)
        with FolderStore(again, FakeClock()) as store:
            assert store.find("x").state is CaptureState.DONE
            assert store.find("y").state is CaptureState.ACCEPTED
            assert store.outcome("x").message.sequence > last
            finish(store, result("y", store))
            assert store.outcome("y").message.sequence > last + 1
        shutil.rmtree(again)


def test_what_was_kept_is_as_old_after_a_rebuild(data):
    clock = FakeClock()
    clock.pass_time(DAY - 10)
    with FolderStore(data, clock):
        pass
    (data / "captures.sqlite3").unlink()
    with FolderStore(data, clock) as store:
        assert store.retention.expired(DAY, 9) == []
        clock.pass_time(10)
        assert store.retention.expired(DAY, 9) == ["done"]


def test_a_frame_without_a_row_gets_its_row(data):
    _forget(data, "waits")
    with FolderStore(data, FakeClock()) as store:
        assert states(store)["waits"] is CaptureState.ACCEPTED
        finish(store, result("waits", store))


def test_a_face_without_a_row_gets_its_row(data):
    with sqlite3.connect(data / "captures.sqlite3") as database:
        database.execute("DELETE FROM outcomes WHERE capture_id = 'done'")
        database.execute("UPDATE captures SET state = 'accepted' WHERE capture_id = 'done'")
    database.close()
    with FolderStore(data, FakeClock()) as store:
        assert states(store)["done"] is CaptureState.DONE
        assert store.outcome("done").message.kind == "face_done"


def test_a_damaged_frame_without_a_row_is_a_dead_letter(data):
    _forget(data, "waits")
    _flip(data / "frames" / "waits.frame", 60)  # in the lengths of its parts
    with FolderStore(data, FakeClock()) as store:
        assert store.find("waits").state is CaptureState.DEAD
        assert "checksum" in store.outcome("waits").message.message
    (report,) = reports(data)
    assert report["capture_id"] == "waits"
    with FolderStore(data, FakeClock()) as store:
        assert store.find("waits").state is CaptureState.DEAD


def test_damage_behind_the_head_of_a_frame_without_a_row_is_found_when_it_is_needed(data):
    _forget(data, "waits")
    _flip(data / "frames" / "waits.frame", -1)
    with FolderStore(data, FakeClock()) as store:
        assert store.find("waits").state is CaptureState.ACCEPTED
        with pytest.raises(CorruptFileError, match="checksum"):
            store.frame("waits")
    (report,) = reports(data)
    assert report["capture_id"] == "waits"


def test_a_frame_cut_short_without_a_row_is_a_dead_letter(data):
    _forget(data, "waits")
    path = data / "frames" / "waits.frame"
    path.write_bytes(path.read_bytes()[:-1])
    with FolderStore(data, FakeClock()) as store:
        assert store.find("waits").state is CaptureState.DEAD


def test_a_flipped_bit_in_a_head_costs_no_face(data):
    """Each bit of the frame's head, while its row is lost and its face is not."""
    path = data / "frames" / "done.frame"
    content = path.read_bytes()
    for position in (*range(18, 60), *range(60, content.index(b"calibration"), 41)):
        (data / "captures.sqlite3").unlink()
        _flip(path, position)
        with FolderStore(data, FakeClock()) as store:
            assert store.find("done").state is CaptureState.DONE, position
            assert store.outcome("done").message.kind == "face_done", position
        path.write_bytes(content)


def test_a_rebuild_reads_the_head_of_each_file_once(data, monkeypatch):
    read = Counter()
    opened, pread = os.open, os.pread

    def noted(path, *arguments, **more):
        descriptor = opened(path, *arguments, **more)
        if str(path).endswith((".frame", ".face")):
            read[Path(path).name, "open"] += 1
            names[descriptor] = Path(path).name
        return descriptor

    def counted(descriptor, size, offset):
        found = pread(descriptor, size, offset)
        read[names[descriptor], "read"] += 1
        read["most"] = max(read["most"], len(found))
        return found

    names = {}
    monkeypatch.setattr(os, "open", noted)
    monkeypatch.setattr(os, "pread", counted)
    monkeypatch.setattr("denseface.service.storage._record_file.read_bounded", None)
    (data / "captures.sqlite3").unlink()
    progress = Progress()
    with FolderStore(data, FakeClock(), progress) as store:
        assert states(store) == REBUILT
    assert read.pop("most") <= 2**14
    assert 5 == progress.read == progress.files == len(read) / 2
    assert set(read.values()) == {1}


def test_a_rebuild_can_be_stopped_and_begun_again(data):
    (data / "captures.sqlite3").unlink()
    with pytest.raises(StoreError, match="stopped"):
        FolderStore(data, FakeClock(), Progress(cancelled=True))
    with FolderStore(data, FakeClock()) as store:
        assert states(store) == REBUILT


def test_a_start_lists_each_folder_once_and_reads_no_file(data, monkeypatch):
    listed = Counter()

    def counted(lists):
        def count(path="."):
            listed[Path(path).name] += 1
            return lists(path)
        return count

    for name in ("listdir", "scandir"):  # which of them `Path.iterdir` takes goes by the version
        monkeypatch.setattr(os, name, counted(getattr(os, name)))
    progress = Progress()
    with FolderStore(data, FakeClock(), progress):
        assert listed == {"frames": 1, "faces": 1, "quarantine": 1, "data": 1}
        assert progress.files == progress.read == 0


def test_a_damaged_face_names_its_capture(data):
    (face,) = (data / "faces").iterdir()
    _flip(face)
    with FolderStore(data, FakeClock()) as store:
        with pytest.raises(DamagedFaceError) as caught:
            store.outcome_after(0)
        assert caught.value.capture_id == "done"
        assert not face.exists()
        store.reopen("done", CaptureState.ACCEPTED, reset_attempts=True)
        assert store.outcome_after(0).message.capture_id == "failed"
        assert store.find("done").state is CaptureState.ACCEPTED


def test_a_frame_under_another_name_gets_no_row(data):
    (data / "frames" / "waits.frame").rename(data / "frames" / "other.frame")
    with FolderStore(data, FakeClock()) as store:
        assert store.find("other") is None
    (report,) = reports(data)
    assert "is of capture waits" in report["reason"]


def test_what_is_not_ours_is_left_alone(data, capsys):
    strange = [data / "notes.txt", data / "frames" / "holiday.jpg"]
    for path in strange:
        path.write_text("mine")
    with FolderStore(data, FakeClock()):
        assert all(path.read_text() == "mine" for path in strange)
    out = capsys.readouterr().out
    assert "notes.txt" in out
    assert "holiday.jpg" in out


def test_quarantine_goes_after_the_retention(data):
    _flip(data / "frames" / "waits.frame")
    clock = FakeClock()
    with FolderStore(data, clock) as store:
        with pytest.raises(StoreError):
            store.frame("waits")
        sweep(store, DAY)
        assert len(reports(data)) == 1
        clock.pass_time(DAY)
        sweep(store, None)
        assert len(reports(data)) == 1
        sweep(store, DAY)
        assert list((data / "quarantine").iterdir()) == []


def test_quarantine_goes_with_its_capture(data):
    _flip(data / "frames" / "waits.frame")
    with FolderStore(data, FakeClock()) as store:
        with pytest.raises(StoreError):
            store.frame("waits")
        store.retention.remove(["dead"], CaptureState.REMOVED)
        store.retention.erase(["dead"])
        assert len(reports(data)) == 1
        store.retention.remove(["waits"], CaptureState.REMOVED)
        store.retention.erase(["waits"])
        assert list((data / "quarantine").iterdir()) == []


def test_a_removal_that_was_cut_short_is_finished(data, monkeypatch):
    def killed(*_):
        raise StoreError("killed")

    with FolderStore(data, FakeClock()) as store:
        monkeypatch.setattr("denseface.service.storage._erasure.sync_folder", killed)
        store.retention.remove(["done", "waits"], CaptureState.REMOVED)
        with pytest.raises(StoreError, match="killed"):
            store.retention.erase(["done", "waits"])
    monkeypatch.undo()
    with FolderStore(data, FakeClock()) as store:
        assert store.find("done") is None
        assert store.counts() == {CaptureState.FAILED: 1, CaptureState.DEAD: 1}
        accept(store, frame("done"), Settings(), "0f")
        assert store.find("done").state is CaptureState.ACCEPTED
        sweep(store, None)
        assert store.find("done").state is CaptureState.ACCEPTED
        assert sorted(path.name for path in (data / "frames").iterdir()) == [
            "dead.frame", "done.frame", "failed.frame"]


@pytest.mark.parametrize(("number", "kind", "message"), [
    (28, DiskFullError, "no room on the disk"), (122, DiskFullError, "no room on the disk"),
    (5, StoreError, "the disk fails")])
@pytest.mark.parametrize("step", ["write", "fsync", "folder"])
def test_a_frame_that_cannot_be_kept_leaves_nothing(
        data, monkeypatch, number, kind, message, step):
    calls = []

    def fails(*_, **__):
        raise OSError(number, os.strerror(number))

    def second_fails(descriptor):
        calls.append(descriptor)
        if len(calls) == 2:
            fails()

    with FolderStore(data, FakeClock()) as store:
        before = sorted((data / "frames").iterdir())
        match step:
            case "write":
                monkeypatch.setattr(
                    "denseface.service.storage._record_file.write_synced", fails)
            case "fsync":
                monkeypatch.setattr("denseface.service.runtime.files.os.fsync", fails)
            case "folder":
                monkeypatch.setattr("denseface.service.runtime.files.os.fsync", second_fails)
        with pytest.raises(kind, match=message):
            accept(store, frame("new"), Settings(), "0f")
        monkeypatch.undo()
        assert sorted((data / "frames").iterdir()) == before
        assert store.find("new") is None
        accept(store, frame("new"), Settings(), "0f")


def test_a_frame_that_cannot_be_named_is_accepted_and_named_later(data, monkeypatch):
    def fails(*_):
        raise OSError(5, os.strerror(5))

    pending, named = (data / "frames" / name for name in ("new.pending", "new.frame"))
    with FolderStore(data, FakeClock()) as store:
        monkeypatch.setattr("pathlib.Path.replace", fails)
        accept(store, frame("new"), Settings(), "0f")
        monkeypatch.undo()
        store.frame("new")  # from memory
        store.frame("new")
        assert pending.exists()
        assert not named.exists()
    with FolderStore(data, FakeClock()) as store:
        store.frame("new")
        assert named.exists()
        assert not pending.exists()


def test_a_frame_without_its_name_and_row_is_nobody_s(data):
    (data / "frames" / "waits.frame").rename(data / "frames" / "waits.pending")
    _forget(data, "waits")
    with FolderStore(data, FakeClock()) as store:
        assert store.find("waits") is None
        assert not (data / "frames" / "waits.pending").exists()


def test_where_the_database_is_lost_whole_frames_without_their_name_count_as_accepted(data):
    for name in ("waits", "dead"):
        (data / "frames" / f"{name}.frame").rename(data / "frames" / f"{name}.pending")
    _flip(data / "frames" / "dead.pending")
    (data / "captures.sqlite3").unlink()
    with FolderStore(data, FakeClock()) as store:
        assert states(store) == REBUILT | {"dead": None}
        store.frame("waits")
    (report,) = reports(data)
    assert report["capture_id"] == "dead"


def test_a_full_database_leaves_no_frame(data):
    with FolderStore(data, FakeClock()) as store:
        pages = store._database.select_one("PRAGMA page_count")[0]
        store._database.select_one(f"PRAGMA max_page_count = {pages}")
        for number in range(200):
            try:
                accept(store, frame(f"x{number}"), Settings(), "0f")
            except DiskFullError as error:
                assert "no room on the disk" in str(error)  # noqa: PT017
                break
        assert store.find(f"x{number}") is None
        assert not (data / "frames" / f"x{number}.frame").exists()
        assert store.find("waits").state is CaptureState.ACCEPTED


def test_a_purge_makes_room_on_a_full_disk(data, monkeypatch):
    with FolderStore(data, FakeClock()) as store:
        real = store.retention._mark

        def full(*arguments):
            if (data / "ballast").exists():
                raise DiskFullError("no room on the disk")
            real(*arguments)

        monkeypatch.setattr(store.retention, "_mark", full)
        assert (data / "ballast").stat().st_size == 2**20
        store.retention.remove(["waits"], CaptureState.REMOVED)
        store.retention.erase(["waits"])
        assert store.find("waits") is None
        assert (data / "ballast").stat().st_size == 2**20


def test_damage_while_serving_ends_the_hub(data):
    with FolderStore(data, FakeClock()) as store:
        store._database.truncate_log()
        path = data / "captures.sqlite3"
        path.write_bytes(path.read_bytes()[:4096] + b"\xff" * 40960)
        with pytest.raises(DamagedDatabaseError):  # noqa: PT012
            store._database.execute("PRAGMA shrink_memory")
            store.counts()


def sweep(store, retention_s):
    """As the hub does now and then."""
    retention = store.retention
    retention.finish(retention.prepare(retention.left_over(9), retention_s=retention_s).run())


def _forget(data, capture_id):
    database = sqlite3.connect(data / "captures.sqlite3")
    with database:
        database.execute("DELETE FROM captures WHERE capture_id = ?", (capture_id,))
    database.close()


def _flip(path, position=None):
    content = bytearray(path.read_bytes())
    content[len(content) // 2 if position is None else position] ^= 1
    path.write_bytes(content)
