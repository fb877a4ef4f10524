"""`summary.parquet`: whole at every moment, no frame twice, the last row wins."""

import errno
import itertools
import os
import random
import shutil
from contextlib import suppress

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from denseface.service.errors import CorruptFileError, DiskFullError, StoreError, UsageError
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.summary import _journal, _table, writer
from denseface.service.tools.batch.summary.schema import COLUMNS, SCHEMA, rows_of, to_batch
from denseface.service.tools.batch.summary.writer import SummaryWriter


def face(source, frame, **more):
    return Row(**{"source": source, "frame": frame, "state": "face", "dense": 1000,
                  "sigma_mm": 0.1 + 0.2, "output": f"{source}_{frame}.npz",
                  "thumbnail": b"\xff\xd8\xff" + bytes(40)} | more)


def refused(source, frame, **more):
    return Row(**{"source": source, "frame": frame, "state": "no_face", "error": "NoFaceError",
                  "why": "nobody"} | more)


def rows_in(folder):
    """Read it as anybody would."""
    return list(rows_of(pq.read_table(folder / "summary.parquet")))


def by_key(rows):
    return sorted(rows, key=lambda row: (row.source, -1 if row.frame is None else row.frame))


@pytest.fixture
def small(monkeypatch):
    """Groups, runs and shares so small that few rows go through all of it."""
    monkeypatch.setattr(writer, "GROUP_ROWS", 5)
    monkeypatch.setattr(_table, "GROUP_ROWS", 5)
    monkeypatch.setattr(writer, "_MOST_RUNS", 4)
    monkeypatch.setattr(writer, "_SMALL_BYTES", 0)


def test_rows_come_back_as_they_were_added_sorted_by_frame(tmp_path):
    added = [face("b.oni", 2), refused("b.oni", 10, warnings=("dark", "far")), face("a.oni", 0),
             Row(source="c.oni", frame=None, state="unreadable", error="CaptureError", why="cut")]
    with SummaryWriter(tmp_path / "made") as summary:
        summary.add(*added[:2])
        summary.add(*added[2:])
    assert rows_in(tmp_path / "made") == by_key(added)
    assert [one.name for one in (tmp_path / "made").iterdir()] == ["summary.parquet"]


def test_what_is_not_known_is_null_so_that_averages_are_of_faces(tmp_path):
    with SummaryWriter(tmp_path) as summary:
        summary.add(face("a", 0), refused("a", 1))
    table = pq.read_table(tmp_path / "summary.parquet")
    assert table.column("dense").to_pylist() == [1000, None]
    assert table.column("thumbnail").to_pylist()[1] is None


def test_the_file_says_what_its_columns_mean_is_compressed_and_sorted(tmp_path):
    SummaryWriter(tmp_path).close()
    with SummaryWriter(tmp_path) as summary:
        summary.add(*(face("a", number) for number in range(3)))
    found = pq.ParquetFile(tmp_path / "summary.parquet")
    for column in COLUMNS:
        field = found.schema_arrow.field(column.name)
        said = {"meaning": column.meaning, "unit": column.unit}
        assert {key.decode(): one.decode() for key, one in field.metadata.items()} == said
        assert field.nullable == column.nullable
        assert ("mm" in column.unit) == column.name.endswith("_mm")
    group = found.metadata.row_group(0)
    assert [one.column_index for one in group.sorting_columns] == [0, 1]
    kinds = {group.column(at).path_in_schema: group.column(at) for at in range(group.num_columns)}
    assert {name for name, one in kinds.items() if one.compression != "ZSTD"} == {"thumbnail"}
    assert kinds["sigma_mm"].statistics.max == pytest.approx(0.3)
    assert kinds["thumbnail"].statistics is None


def test_the_last_row_of_a_frame_wins_within_a_run_and_in_the_next(tmp_path):
    with SummaryWriter(tmp_path) as summary:
        summary.add(refused("a", 0, attempts=1), refused("a", 0, attempts=2))
        summary.add(refused("a", 0, attempts=3), face("a", 1))
    assert [row.attempts for row in rows_in(tmp_path)] == [3, 1]
    with SummaryWriter(tmp_path) as summary:
        assert summary.earlier == {"no_face": 1, "face": 1}
        assert summary.known("a", 0) == ("no_face", None, "NoFaceError", 3)
        assert summary.known("a", 1) == ("face", "a_1.npz", "", 1)
        assert [summary.known(*key) for key in (("a", 2), ("a", None), ("", 0), ("b", 0))] == [
            None] * 4
        summary.add(face("a", 0))
    assert rows_in(tmp_path) == [face("a", 0), face("a", 1)]


def test_a_source_that_can_be_opened_again_is_no_longer_listed_as_unreadable(tmp_path):
    gone = Row(source="a", frame=None, state="unreadable", error="CaptureError", why="no disk")
    with SummaryWriter(tmp_path) as summary:
        summary.add(gone, gone.model_copy(update={"source": "b"}))
    with SummaryWriter(tmp_path) as summary:
        summary.add(face("a", 0))
        summary.add(face("a", 1), face("c", 0))
    assert [row.key for row in rows_in(tmp_path)] == [("a", 0), ("a", 1), ("b", None), ("c", 0)]
    with SummaryWriter(tmp_path) as summary:
        summary.add(face("b", 0))
        summary.add(gone.model_copy(update={"source": "b"}))  # and then it broke
    assert [row.key for row in rows_in(tmp_path)][2:4] == [("b", None), ("b", 0)]


def test_a_name_that_is_no_text_is_kept_escaped_and_found(tmp_path):
    name = os.fsdecode(b"caf\xe9.oni")
    with SummaryWriter(tmp_path) as summary:
        summary.add(face(name, 0, output=None))
    with SummaryWriter(tmp_path) as summary:
        assert summary.known(name, 0).state == "face"
    assert rows_in(tmp_path)[0].source == r"caf\udce9.oni"


def test_rows_in_any_order_and_many_runs_are_one_sorted_file(tmp_path, small):
    choose = random.Random(16)
    expected = {}
    for _ in range(3):
        with SummaryWriter(tmp_path) as summary:
            for _ in range(12):
                rows = [choose.choice((face, refused))(
                    choose.choice("abc"), choose.randrange(16), attempts=choose.randrange(99))
                    for _ in range(choose.randrange(1, 5))]
                summary.add(*rows)
                expected |= {row.key: row for row in rows}
        assert rows_in(tmp_path) == by_key(expected.values())
        with SummaryWriter(tmp_path) as summary:
            for row in expected.values():
                assert summary.known(*row.key)[::3] == (row.state, row.attempts)
    groups = pq.ParquetFile(tmp_path / "summary.parquet").metadata
    assert {groups.row_group(at).num_rows for at in range(groups.num_row_groups - 1)} == {5}


class Killed(BaseException):
    """Nothing is done after it."""


def test_at_each_change_of_the_disk_a_kill_leaves_a_whole_file_and_loses_no_row(
        tmp_path, small, monkeypatch):
    """Die before the n-th call that changes a file, for each n, and look at what is there."""
    calls = ["replace", "unlink", "ftruncate", "pwrite", "fsync"]

    def run(folder, dies_at):
        counter = itertools.count()

        def deadly(name, call):
            def die_or(*args, **kwargs):
                if next(counter) >= dies_at:
                    if dies_at % 2 and name == "pwrite":  # half of it was written
                        call(args[0], args[1][:len(args[1]) // 2], args[2])
                    raise Killed
                return call(*args, **kwargs)
            return die_or

        sure = {}
        with monkeypatch.context() as patch:
            for name in calls:
                patch.setattr(os, name, deadly(name, getattr(os, name)))
            with suppress(Killed):
                summary = SummaryWriter(folder)
                for number in range(0, 20, 2):
                    rows = [face("ab"[at % 2], at % 7, attempts=at) for at in (number, number + 1)]
                    summary.add(*rows)
                    sure |= {row.key: row for row in rows}
                summary.close()
                return sure, True
        return sure, False

    SummaryWriter(tmp_path / "before").close()
    for dies_at in itertools.count():
        folder = tmp_path / str(dies_at)
        shutil.copytree(tmp_path / "before", folder)
        sure, done = run(folder, dies_at)
        after = tmp_path / "as a kill leaves it"
        shutil.copytree(folder, after)  # without the lock that a dead process has not either
        keys = [row.key for row in rows_in(after)]
        assert len(keys) == len(set(keys))
        SummaryWriter(after).close()
        found = {row.key: row for row in rows_in(after)}
        assert len(found) == len(rows_in(after))
        assert all(found[key].attempts >= row.attempts for key, row in sure.items())
        assert [one.name for one in after.iterdir()] == ["summary.parquet"]
        shutil.rmtree(after)
        if done:
            break
    assert dies_at > 30


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_full_disk_is_one_line_and_what_was_there_stays(tmp_path, monkeypatch, number):
    with SummaryWriter(tmp_path) as summary:
        summary.add(face("a", 0))
    summary = SummaryWriter(tmp_path)
    summary.add(face("a", 1))

    def full(*_):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        with pytest.raises(StoreError, match=r"journal\.arrows: ") as error:
            summary.add(face("a", 2))
        assert (type(error.value) is DiskFullError) == (number == errno.ENOSPC)
        patch.setattr(os, "fsync", full)
        with pytest.raises(StoreError, match=r"summary\.parquet: "):
            summary.close()
    assert [row.frame for row in rows_in(tmp_path)] == [0]
    SummaryWriter(tmp_path).close()
    assert [row.frame for row in rows_in(tmp_path)] == [0, 1]


def test_two_runs_do_not_write_into_the_same_folder(tmp_path):
    with SummaryWriter(tmp_path), pytest.raises(UsageError, match="another run"):
        SummaryWriter(tmp_path)
    SummaryWriter(tmp_path).close()


@pytest.mark.parametrize("contents", [b"", b"PAR1", b"hello" * 100, None, "other"])
def test_a_file_that_is_no_summary_is_refused_and_left_alone(tmp_path, contents):
    path = tmp_path / "summary.parquet"
    if contents == "other":
        pq.write_table(pa.table({"source": ["a"]}), path)
    elif contents is None:
        pq.write_table(SCHEMA.empty_table().drop_columns("why"), path)
    else:
        path.write_bytes(contents)
    before = path.read_bytes()
    with pytest.raises(CorruptFileError, match=r"summary\.parquet: .* move it away") as error:
        SummaryWriter(tmp_path)
    assert "\n" not in str(error.value)
    assert path.read_bytes() == before


def test_damage_anywhere_in_the_file_is_one_line(tmp_path):
    with SummaryWriter(tmp_path) as summary:
        summary.add(*(face("a", number) for number in range(50)))
    path = tmp_path / "summary.parquet"
    whole = path.read_bytes()
    for at in range(0, len(whole), max(1, len(whole) // 25)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1:])
        # Some bytes mean nothing.
        with suppress(CorruptFileError), SummaryWriter(tmp_path) as summary:
            summary.add(face("b", 0))
        shutil.rmtree(tmp_path / ".summary", ignore_errors=True)


def test_a_journal_is_read_up_to_where_it_is_torn_whatever_is_behind(tmp_path):
    journal = _journal.Journal(tmp_path / "j")
    journal.begin(7)
    ends = []
    for number in range(3):
        journal.append(to_batch([face("a", number)]))
        ends.append((tmp_path / "j").stat().st_size)
    journal.close()
    data = (tmp_path / "j").read_bytes()
    for cut in range(0, len(data), 37):
        _, table = _journal.read_stream(data[:cut])
        assert len(table) == sum(end <= cut for end in ends)
        for behind in (bytes(500), b"\xff" * 500):
            assert len(_journal.read_stream(data[:cut] + behind)[1]) <= 3
