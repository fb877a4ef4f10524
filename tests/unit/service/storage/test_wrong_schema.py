"""A database of the right version and the wrong contents is made again from the files."""

import sqlite3

import pytest

from denseface.recon.settings import Settings
from denseface.service.errors import DamagedDatabaseError
from denseface.service.protocol.states import CaptureState
from denseface.service.storage import FolderStore
from denseface.service.storage._database import Database
from tests.unit.service.clocks import FakeClock
from tests.unit.service.storage.test_folder_store import frame, result
from tests.unit.service.storage.test_recovery import REBUILT, reports, states
from tests.unit.service.storing import accept, finish

WRONG = {
    "a table is missing": "DROP TABLE outcomes",
    "all tables but one are missing": "DROP TABLE outcomes; DROP TABLE captures",
    "a column is missing": "ALTER TABLE captures DROP COLUMN pressed_by",
    "a column too many": "ALTER TABLE captures ADD COLUMN secret TEXT NOT NULL DEFAULT ''",
    "a column has another name": "ALTER TABLE outcomes RENAME COLUMN message TO text",
    "a table too many": "CREATE TABLE more (name TEXT)",
    "a trigger": "CREATE TRIGGER more AFTER INSERT ON captures"
                 " BEGIN DELETE FROM captures; END",
    "a view": "CREATE VIEW more AS SELECT * FROM captures",
    "other conditions": "PRAGMA writable_schema=ON; UPDATE sqlite_schema SET"
                        " sql = replace(sql, 'attempts >= 0', 'attempts < 0 OR 1')",
    "the epoch is no number": "UPDATE meta SET value = 'yesterday' WHERE name = 'epoch'",
    "the epoch is short": "UPDATE meta SET value = '0f' WHERE name = 'epoch'",
    "accepted, with an outcome": "UPDATE captures SET state = 'accepted' WHERE capture_id = 'done'",
    "removed, with an outcome": "UPDATE captures SET state = 'removed' WHERE capture_id = 'done'",
    "done, without an outcome": "UPDATE captures SET state = 'done' WHERE capture_id = 'waits'",
    "failed, with a face": "UPDATE captures SET state = 'failed' WHERE capture_id = 'done'",
    "dead, and not given up": "UPDATE outcomes SET dead = 0 WHERE capture_id = 'dead'",
    "done, and given up": "UPDATE outcomes SET dead = 1 WHERE capture_id = 'done'",
    "an outcome of nothing": "PRAGMA foreign_keys=OFF; INSERT INTO outcomes (capture_id, error,"
                             " message, dead, finished_at, finished_age_s)"
                             " VALUES ('x', 'E', 'm', 0, '2026-01-31T12:00:00.000+00:00', 0)",
    "an id that is none": "UPDATE captures SET capture_id = '-waits' WHERE capture_id = 'waits'",
    "a time that is none": "UPDATE captures SET accepted_at = '2026-01-31'",
    "an outcome's time": "UPDATE outcomes SET finished_at = '2026-01-31'",
    "an error without end": "UPDATE outcomes SET error = printf('%5000s', 'x')"
                            " WHERE capture_id = 'failed'",
    "an age without end": "UPDATE outcomes SET finished_age_s = 9e999",
    "the last position": "UPDATE sqlite_sequence SET seq = 9223372036854775807"
                         " WHERE name = 'captures'",
    "no last number": "DELETE FROM sqlite_sequence",
    "attempts without end": "UPDATE captures SET attempts = 9223372036854775807",
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_database_that_does_not_fit_is_made_again_from_the_files(data, wrong):
    with sqlite3.connect(data / "captures.sqlite3") as database:
        database.executescript(wrong)
    database.close()
    with FolderStore(data, FakeClock()) as store:
        assert states(store) == REBUILT
        assert store.outcome_after(0).message.capture_id == "done"
        accept(store, frame("new"), Settings(), "0f")
        finish(store, result("new", store))
    (report,) = reports(data)
    assert report["file"].endswith("captures.sqlite3")


def test_a_database_without_the_newer_indexes_or_with_more_fits(data):
    """An older one, and one that a later version has opened."""
    with sqlite3.connect(data / "captures.sqlite3") as database:
        for (name,) in database.execute(
                "SELECT name FROM sqlite_schema WHERE type = 'index' AND sql IS NOT NULL"
        ).fetchall():
            database.execute(f"DROP INDEX {name}")
        database.execute("CREATE INDEX later ON captures (accepted_at)")
        database.execute("CREATE UNIQUE INDEX one ON captures (settings_hash)"
                         " WHERE capture_id >= 'x'")
    database.close()
    with FolderStore(data, FakeClock()) as store:
        assert states(store) == {"done": CaptureState.DONE, "failed": CaptureState.FAILED,
                                 "dead": CaptureState.DEAD, "waits": CaptureState.ACCEPTED}
        for name in ("x", "y"):
            accept(store, frame(name), Settings(), "0f")
    assert reports(data) == []


def test_what_does_not_fit_is_named(tmp_path):
    path = tmp_path / "x.sqlite3"
    Database(path).close()
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE more (name TEXT)")
    database.close()
    with pytest.raises(DamagedDatabaseError, match=r"schema differs in more"):
        Database(path)
