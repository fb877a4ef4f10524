"""Files that somebody else put into the data folder: named, never counted, never removed."""

import pytest
from structlog.testing import capture_logs

from denseface.service.errors import CorruptFileError
from denseface.service.storage import FolderStore, kept_bytes

OTHERS = ["face.ply", "face.json", ".notes.tmp", "frames/face.ply", "frames/.mine.tmp",
          "faces/a.face", "quarantine/report.json", "quarantine/report", "quarantine/.mine.tmp"]


def test_what_is_not_the_hubs_own_stays_and_is_named_in_one_line(data):
    before = kept_bytes(data)
    assert before == sum(path.stat().st_size for path in data.rglob("*") if path.is_file())
    for name in OTHERS:
        (data / name).write_text('{"capture_id": "done", "age_s": 0}' * 40)
    (data / "exports").mkdir()
    (data / "exports" / "face.ply").touch()
    assert kept_bytes(data) == before
    with capture_logs() as log, FolderStore(data) as store:
        damaged = data / "frames" / "waits.frame"
        damaged.write_bytes(damaged.read_bytes()[:-1])
        with pytest.raises(CorruptFileError):
            store.frame("waits")
        assert len([*(data / "quarantine").iterdir()]) == 2 + 3
        done = store.retention.prepare(
            ["done", "failed", "dead", "waits"], all_quarantined=True, retention_s=0.0).run()
        store.retention.finish(done)
    assert sorted(str(path.relative_to(data)) for path in data.rglob("*") if path.is_file()) == (
        sorted([*OTHERS, "exports/face.ply", "ballast", "captures.sqlite3", "lock"]))
    (line,) = [one for one in log if "own" in one["event"]]
    assert line["event"] == "not the hub's own, neither counted nor removed"
    assert line["number"] == len(OTHERS) + 1  # a folder is one, whatever is in it
    assert set(line["files"]) < {*OTHERS, "exports"}


def test_nothing_is_said_of_a_folder_that_is_the_hubs_alone(data):
    with capture_logs() as log, FolderStore(data):
        assert [one for one in log if "own" in one["event"]] == []
