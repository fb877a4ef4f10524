"""What is on a disk after a power cut."""

import pytest

from tests.chaos.power_cut import VARIANTS, Disk, Record, read_log

LOST, NAMED, KEPT = VARIANTS


@pytest.fixture
def disk():
    return Disk()


def do(disk, kind, descriptor=0, value=0, path="", other="", data=b""):
    disk.do(Record(kind, 0, descriptor, value, path, other, data))


def found(disk, folder, variant):
    disk.write_to(folder / variant, variant)
    return {path.name: path.read_bytes() for path in (folder / variant).iterdir()}


def after_cut(disk, folder):
    return [found(disk, folder, variant) for variant in VARIANTS]


def test_a_file_is_safe_when_it_and_its_folder_are_synced(disk, tmp_path):
    do(disk, "open", 3, path="a")
    do(disk, "write", 3, data=b"new")
    assert after_cut(disk, tmp_path / "1") == [{}, {"a": b""}, {"a": b"new"}]
    do(disk, "sync", 3)
    assert after_cut(disk, tmp_path / "2") == [{}, {"a": b"new"}, {"a": b"new"}]
    do(disk, "open", 4, path=".")
    do(disk, "sync", 4)
    assert after_cut(disk, tmp_path / "3") == [{"a": b"new"}] * 3


def test_names_change_with_the_sync_of_their_folder(disk, tmp_path):
    do(disk, "open", 3, path="a")
    do(disk, "write", 3, data=b"1")
    do(disk, "sync", 3)
    do(disk, "open", 4, path=".")
    do(disk, "sync", 4)
    do(disk, "rename", path="a", other="b")
    assert after_cut(disk, tmp_path / "1") == [{"a": b"1"}, {"b": b"1"}, {"b": b"1"}]
    do(disk, "sync", 4)
    do(disk, "unlink", path="b")
    assert after_cut(disk, tmp_path / "2") == [{"b": b"1"}, {}, {}]


def test_what_a_failed_sync_did_not_write_no_later_one_writes(disk, tmp_path):
    do(disk, "open", 3, path="a")
    do(disk, "open", 4, path=".")
    do(disk, "sync", 4)
    do(disk, "write", 3, data=b"x" * 4096)
    do(disk, "failed", 3, path="fsync")
    do(disk, "write", 3, value=4096, data=b"y")
    do(disk, "sync", 3)
    lost, _, kept = after_cut(disk, tmp_path)
    assert lost == {"a": bytes(4096) + b"y"}
    assert kept == {"a": b"x" * 4096 + b"y"}


def test_a_log_is_read_as_it_was_written(tmp_path):
    log, folder = tmp_path / "log", tmp_path / "data"
    log.write_bytes(f"open\t0\t3\t1\t0\t{folder}/a\t\nwrite\t1\t3\t7\t4\t\t\n\n\t\n\0"
                    "mark\t1\t0\t0\t0\t[\"said\"]\t\n".encode())
    assert list(read_log(log, folder)) == [
        Record("open", 0, 3, 1, "a", "", b""), Record("write", 1, 3, 7, "a", "", b"\n\t\n\0"),
        Record("mark", 1, 0, 0, '["said"]', "", b"")]
