"""The data folder."""

import os
import stat
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import CorruptFileError, HubRunningError, SettingsError, StoreError
from denseface.service.protocol import messages
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore, _database, write
from denseface.service.storage._frame_cache import FrameCache
from denseface.service.storage._record_file import read_parts, write_parts
from tests.unit.service.faces import small_face, small_frame
from tests.unit.service.storing import accept, finish


@pytest.fixture
def store(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        yield store


def frame(capture_id: str) -> Packet:
    header, arrays = FrameHeader.of(small_frame())
    return Packet(messages.Frame(capture_id=capture_id, frame=header), arrays)


def result(capture_id: str, store: FolderStore) -> Packet:
    header, arrays = FaceHeader.of(small_face())
    return Packet(
        messages.Result(capture_id=capture_id, settings_hash="0f", face=header,
                        frame_sha256=store.find(capture_id).frame_sha256), arrays)


def test_an_accepted_frame_survives_closing(tmp_path):
    settings = Settings.of("faithful", ratio=7)
    with FolderStore(tmp_path / "data") as store:
        accept(store, frame("a"), settings, "0f")
        accept(store, frame("b"), settings, "0f")
        epoch = store.epoch
    with FolderStore(tmp_path / "data") as store:
        assert store.epoch == epoch
        assert store.unfinished() == ["a", "b"]
        row = store.find("a")
        assert row is not None
        assert (row.state, row.attempts) == (CaptureState.ACCEPTED, 0)
        record = store.frame("a")
        assert Settings.model_validate_json(record.metadata.settings) == settings
        depth = record.message.frame.join(record.arrays).depth
        np.testing.assert_array_equal(depth, small_frame().depth)
        assert store.start_attempt("a") == 1
        assert store.start_attempt("a") == 2


def test_a_row_comes_after_its_file_is_safe(store, monkeypatch):
    steps = []
    sync, rename, transaction = os.fsync, Path.replace, store._database.transaction

    def synced(descriptor):
        steps.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        sync(descriptor)

    def renamed(path, target):
        steps.append(target.name)
        return rename(path, target)

    def begun():
        steps.append("row")
        return transaction()

    monkeypatch.setattr("denseface.service.runtime.files.os.fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    pending = store.prepare_frame(frame("a"), Settings(), "0f")
    monkeypatch.setattr(store._database, "transaction", begun)
    store.accept(write([pending]), CaptureState.ACCEPTED)
    assert steps == ["file", "folder", "row", "a.frame"]
    assert store._database.select_one("PRAGMA synchronous")[0] == 2
    assert store._database.select_one("PRAGMA journal_mode")[0] == "wal"


def test_outcomes_are_numbered_in_order(store):
    for name in "abc":
        accept(store, frame(name), Settings(), "0f")
    finish(store, result("b", store))
    store.fail("a", CaptureState.FAILED, "NoFaceError", "no face")
    store.fail("c", CaptureState.DEAD, "WorkerLost", "gone")
    assert store.unfinished() == []
    assert store.last_sequence() == 3
    assert store.counts() == {CaptureState.DONE: 1, CaptureState.FAILED: 1, CaptureState.DEAD: 1}
    first, second, third = (store.outcome_after(n).message for n in range(3))
    assert isinstance(first, messages.FaceDone)
    assert (first.capture_id, first.sequence) == ("b", 1)
    assert (second.capture_id, second.error, second.dead) == ("a", "NoFaceError", False)
    assert (third.capture_id, third.dead) == ("c", True)
    assert store.outcome_after(3) is None
    assert store.outcome("c").message == third
    assert store.outcome("d") is None


def test_a_reason_is_as_long_as_a_message_may_be(store):
    accept(store, frame("a"), Settings(), "0f")
    store.fail("a", CaptureState.DEAD, "E" * 300, "m" * 5000)
    message = store.outcome("a").message
    assert (len(message.error), len(message.message)) == (200, 4000)


def test_a_second_outcome_changes_nothing(store):
    accept(store, frame("a"), Settings(), "0f")
    finish(store, result("a", store))
    with pytest.raises(StoreError, match="UNIQUE"):
        store.fail("a", CaptureState.DEAD, "WorkerLost", "late")
    assert store.last_sequence() == 1
    assert store.find("a").state is CaptureState.DONE


def test_a_damaged_frame_is_named(store, tmp_path):
    accept(store, frame("a"), Settings(), "0f")
    path = tmp_path / "data" / "frames" / "a.frame"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    store.frame("a")  # the first time from memory
    with pytest.raises(CorruptFileError, match=r"a\.frame: contents"):
        store.frame("a")
    assert not path.exists()
    with pytest.raises(CorruptFileError, match="No such file"):
        store.frame("a")


def test_two_hubs_cannot_have_one_folder(store, tmp_path):
    with pytest.raises(HubRunningError, match="another hub"):
        FolderStore(tmp_path / "data")


def test_the_folder_is_private_and_swept(tmp_path):
    for folder in ("data", "data/frames"):
        (tmp_path / folder).mkdir(mode=0o700)
    left = tmp_path / "data" / "frames" / ".a.frame.77.tmp"
    left.write_bytes(b"half")
    with FolderStore(tmp_path / "data"):
        assert not left.exists()
        assert (tmp_path / "data").stat().st_mode & 0o777 == 0o700


def test_a_file_in_the_folder_s_place_is_named(tmp_path):
    (tmp_path / "data").write_text("")
    with pytest.raises(SettingsError, match="data"):
        FolderStore(tmp_path / "data")


def test_parts_come_back_as_they_were(tmp_path):
    parts = [b"header", b"", os.urandom(1000)]
    checksum = write_parts(tmp_path / "x", parts)
    assert read_parts(tmp_path / "x", checksum) == read_parts(tmp_path / "x") == (parts, checksum)
    with pytest.raises(CorruptFileError):
        read_parts(tmp_path / "x", "0" * 64)


def test_no_flipped_bit_and_no_swap_of_parts_goes_unseen(tmp_path):
    path = tmp_path / "x"
    checksum = write_parts(path, [b"header", b"", bytes(range(64)), bytes(reversed(range(64)))])
    content = path.read_bytes()
    for position in range(len(content)):
        for bit in range(8):
            spoiled = bytearray(content)
            spoiled[position] ^= 1 << bit
            path.write_bytes(spoiled)
            with pytest.raises(CorruptFileError):
                read_parts(path, checksum)
    for spoiled in (content[:-128] + content[-64:] + content[-128:-64], content[:-1],
                    content + b"\0"):
        path.write_bytes(spoiled)
        with pytest.raises(CorruptFileError):
            read_parts(path)


def test_a_full_disk_leaves_nothing_half_written(tmp_path, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("denseface.service.runtime.files.os.fsync", full)
    with pytest.raises(StoreError, match="No space left"):
        write_parts(tmp_path / "x", [b"data"])
    assert list(tmp_path.iterdir()) == []


def test_frames_are_held_in_memory_as_far_as_there_is_room(store, monkeypatch):
    size = sum(array.nbytes for array in frame("a").arrays.values())
    monkeypatch.setattr("denseface.service.storage._frame_cache._MAX_BYTES", 2 * size)
    cache = FrameCache()
    records = {}
    for name in "abc":
        accept(store, frame(name), Settings(), "0f")
        records[name] = store.frame(name)
    cache.add(records.values())
    assert cache.pop("c") is None
    assert cache.pop("a") is records["a"]
    assert cache.pop("a") is None
    cache.add([records["c"]])
    assert [cache.pop(name) for name in "bc"] == [records["b"], records["c"]]


def test_no_question_reads_all_rows(store):
    """But which captures were accepted before a time: an operator asks it, and removes them."""
    asked = []
    select = store._database.select
    store._database.select = lambda *one: asked.append(one) or select(*one)
    one = store._database.select_one
    store._database.select_one = lambda *what: asked.append(what) or one(*what)
    store.dead_letters(after=0, limit=50)
    store.unfinished()
    store.counts()
    store.find("a")
    store.outcome("a")
    store.outcome_after(0)
    store.sequence_before_time(datetime(2026, 1, 31, tzinfo=UTC))
    store.retention.expired(1.0, 50)
    assert len(asked) >= 8
    for statement, *values in asked:
        plan = [row["detail"] for row in select(f"EXPLAIN QUERY PLAN {statement}", *values)]
        scans = [line for line in plan if line.startswith("SCAN") and "COVERING" not in line]
        assert scans in ([], ["SCAN sqlite_sequence"]), statement


def test_an_older_database_gets_its_indexes(tmp_path):
    with FolderStore(tmp_path / "data") as store:
        accept(store, frame("a"), Settings(), "0f")
        epoch = store.epoch
        names = store._database.select("SELECT name FROM sqlite_master WHERE sql LIKE '% INDEX %'")
        for row in names:
            store._database.execute(f"DROP INDEX {row['name']}")
    with FolderStore(tmp_path / "data") as store:
        assert store.epoch == epoch
        assert names
        assert store._database.select(
            "SELECT name FROM sqlite_master WHERE sql LIKE '% INDEX %'") == names


def test_the_log_is_copied_into_the_database_by_what_is_synced_alone(store, tmp_path):
    accept(store, frame("a"), Settings(), "0f")
    log = tmp_path / "data" / "captures.sqlite3-wal"
    pages = _database._LOG_PAGES
    before = log.stat().st_size // 4096
    for _ in range(pages):
        store.start_attempt("a")
    assert log.stat().st_size // 4096 >= before + pages
    accept(store, frame("b"), Settings(), "0f")
    size = log.stat().st_size
    store.start_attempt("a")
    assert log.stat().st_size == size  # begun anew from its start
