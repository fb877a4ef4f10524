"""The SQLite database of the data folder; its errors become those of the service."""

import os
import secrets
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from copy import copy
from pathlib import Path
from threading import Event
from typing import Self

from denseface.service.errors import DamagedDatabaseError, DiskFullError, StoreError
from denseface.service.runtime.files import sync_folder
from denseface.service.storage._record_file import wrap_os_errors

_VERSION = 4
"""Version of the schema, in `PRAGMA user_version`."""
_MAX_NUMBER = 2**53
"""Sequence numbers, positions and attempts stay below it; a higher one is damage."""
MAX_ERROR, MAX_MESSAGE = 200, 4000
"""Characters of an outcome's error and its reason, as `CaptureFailed` allows."""
_BUSY_S = 1.0
"""Longest wait for another program that has the database open, seconds."""
_CHUNK_BYTES = 2**20
"""Of the log, in memory at a time."""
_LOG_PAGES = 1000
"""Pages of the write-ahead log beyond which SQLite copies them into the database; its default."""
_LOG_TRIES, _LOG_PAUSE_S = 10, 0.005
"""Another thread's read of the database is over by the last try; seconds between them."""
_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_IOERR_READ,
           sqlite3.SQLITE_IOERR_SHORT_READ, sqlite3.SQLITE_IOERR_CORRUPTFS)
"""Result codes, primary or extended, of a malformed database."""
_CONSENTS = """
CREATE TABLE consents (
    capture_id TEXT PRIMARY KEY REFERENCES captures (capture_id) ON DELETE CASCADE,
    text_version TEXT NOT NULL CHECK (length(text_version) BETWEEN 1 AND 64),
    language TEXT NOT NULL CHECK (language != '' AND language NOT GLOB '*[^A-Za-z0-9-]*'),
    retention_s REAL CHECK (retention_s > 0),
    agreed_at TEXT NOT NULL CHECK (datetime(agreed_at) IS NOT NULL),
    due_age_s REAL,
    CHECK ((retention_s IS NULL) = (due_age_s IS NULL))
) STRICT;
"""
_SCHEMA = f"""
CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE captures (
    position INTEGER PRIMARY KEY AUTOINCREMENT,
    capture_id TEXT NOT NULL UNIQUE
        CHECK (length(capture_id) BETWEEN 1 AND 64 AND capture_id NOT GLOB '*[^A-Za-z0-9_-]*'),
    state TEXT NOT NULL CHECK (state IN ('accepted', 'done', 'failed', 'dead', 'removed')),
    settings_hash TEXT NOT NULL CHECK (settings_hash NOT GLOB '*[^0-9a-f]*'),
    attempts INTEGER NOT NULL DEFAULT 0 CHECK (attempts >= 0),
    frame_sha256 TEXT NOT NULL
        CHECK (length(frame_sha256) = 64 AND frame_sha256 NOT GLOB '*[^0-9a-f]*'),
    accepted_at TEXT NOT NULL CHECK (datetime(accepted_at) IS NOT NULL),
    pressed_by TEXT NOT NULL CHECK (pressed_by NOT GLOB '*[^0-9a-f]*')
) STRICT;
CREATE TABLE outcomes (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    capture_id TEXT NOT NULL UNIQUE REFERENCES captures (capture_id),
    face_sha256 TEXT CHECK (length(face_sha256) = 64 AND face_sha256 NOT GLOB '*[^0-9a-f]*'),
    error TEXT,
    message TEXT,
    dead INTEGER NOT NULL CHECK (dead IN (0, 1)),
    finished_at TEXT NOT NULL CHECK (datetime(finished_at) IS NOT NULL),
    finished_age_s REAL NOT NULL,
    CHECK ((face_sha256 IS NULL) = (error IS NOT NULL AND message IS NOT NULL))
) STRICT;
{_CONSENTS}
PRAGMA user_version = {_VERSION};
"""
"""By the CHECK clauses, `integrity_check` finds flipped bits in what the hub acts on."""
_INDEXES = """
CREATE INDEX IF NOT EXISTS captures_by_state ON captures (state);
CREATE INDEX IF NOT EXISTS dead_letters ON outcomes (sequence) WHERE dead;
CREATE INDEX IF NOT EXISTS outcomes_by_time ON outcomes (finished_at);
CREATE INDEX IF NOT EXISTS outcomes_by_age ON outcomes (finished_age_s);
CREATE INDEX IF NOT EXISTS promises ON consents (due_age_s) WHERE due_age_s IS NOT NULL;
"""
"""Added to an older database too; they are no part of `_VERSION`, as a rebuild loses outcomes."""
_TIME = "-".join(["[0-9]" * 4, "[0-9]" * 2, "[0-9]" * 2 + "T*+00:00"])
"""As `format_timestamp` writes it, for GLOB; that it is a time is a CHECK of the schema."""
_IMPOSSIBLE = {
    "an epoch": """
        SELECT value FROM meta WHERE name = 'epoch'
            AND (length(value) != 16 OR value GLOB '*[^0-9a-f]*')""",
    "a capture": f"""
        SELECT capture_id FROM captures WHERE capture_id NOT GLOB '[A-Za-z0-9]*'
            OR accepted_at NOT GLOB '{_TIME}' OR attempts >= {_MAX_NUMBER}""",  # noqa: S608
    "an outcome": f"""
        SELECT sequence FROM outcomes WHERE finished_at NOT GLOB '{_TIME}'
            OR abs(finished_age_s) >= {_MAX_NUMBER}
            OR length(error) > {MAX_ERROR} OR length(message) > {MAX_MESSAGE}""",  # noqa: S608
    "a consent of": f"""
        SELECT capture_id FROM consents WHERE max(retention_s, abs(due_age_s)) >= {_MAX_NUMBER}
            OR agreed_at NOT GLOB '{_TIME}'""",  # noqa: S608
    "the state of": """
        SELECT capture_id FROM captures LEFT JOIN outcomes USING (capture_id) WHERE state != CASE
            WHEN sequence IS NULL THEN iif(state = 'removed', 'removed', 'accepted')
            WHEN face_sha256 IS NULL THEN iif(dead, 'dead', 'failed')
            ELSE iif(dead, '', 'done') END""",
    "the last number of": f"""
        SELECT name FROM (
            SELECT 'captures' AS name, (SELECT max(position) FROM captures) AS highest
            UNION ALL SELECT 'outcomes', (SELECT max(sequence) FROM outcomes))
            LEFT JOIN sqlite_sequence USING (name)
            WHERE coalesce(seq, 0) NOT BETWEEN coalesce(highest, 0) AND {_MAX_NUMBER - 1}""",  # noqa: S608
    "a reference from": """
        SELECT "table" FROM pragma_foreign_key_check""",
}
"""What a sound database never holds: name of it -> query that finds it.

The hub would end, or say what is not so."""


class Database:
    """`captures.sqlite3`, open.

    Raises
    ------
    DamagedDatabaseError
        Where it is malformed, no database, or of another version.
    StoreError
        Where it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_new = False
        """There was none, or an empty one."""
        self._unsettled = Event()
        """Set where a sync or commit failed, of this connection or another: see `settle`."""
        log = path.with_name(f"{path.name}-wal")
        self.left_open = log.exists() and log.stat().st_size > 0
        """The last hub was killed: some of its last rows may be lost."""
        if self.left_open:
            with wrap_os_errors(log):
                _sync_again(log)
        self._connect()
        try:
            with self._translate_errors():
                self._check()
        except BaseException:
            self._connection.close()
            raise

    def another(self) -> Self:
        """Open it once more, for another thread; StoreError where that fails."""
        another = copy(self)
        another._connect()
        return another

    def _connect(self) -> None:
        with self._translate_errors():
            # One thread at a time uses it; which one may change.
            self._connection = sqlite3.connect(
                self.path, isolation_level=None, timeout=_BUSY_S, check_same_thread=False)
            try:
                self._connection.row_factory = sqlite3.Row
                self._connection.text_factory = lambda text: text.decode(errors="replace")
                self._connection.executescript(
                    "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"
                    "PRAGMA secure_delete=ON")
            except BaseException:
                self._connection.close()
                raise

    def _check(self) -> None:
        connection = self._connection
        if connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0] == 0:
            self.is_new = True
            connection.executescript(f"BEGIN; {_SCHEMA} COMMIT")
            sync_folder(self.path.parent)  # SQLite syncs the name of its log alone
        elif connection.execute("PRAGMA user_version").fetchone()[0] == _VERSION - 1:
            connection.executescript(f"BEGIN; {_CONSENTS} PRAGMA user_version = {_VERSION}; COMMIT")
        if damage := next(self._damage(), None):
            raise DamagedDatabaseError(f"{self.path}: {' '.join(damage.split())}"[:500])
        self._make_indexes()
        connection.execute(
            "INSERT OR IGNORE INTO meta VALUES ('epoch', ?)", (secrets.token_hex(8),))

    def _damage(self) -> Iterator[str]:
        """Say what is wrong, the coarsest first: what comes later relies on what came before."""
        connection = self._connection
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        if version != _VERSION:
            yield f"is of version {version}, {_VERSION} expected"
        with closing(sqlite3.connect(":memory:")) as sound:
            sound.executescript(_SCHEMA)
            for name in sorted({name for name, _ in _schema(connection) ^ _schema(sound)}):
                yield f"the schema differs in {name}"
        found = [row[0] for row in connection.execute("PRAGMA integrity_check(3)")]
        if found != ["ok"]:
            yield "; ".join(found)
        for what, query in _IMPOSSIBLE.items():
            if row := connection.execute(f"{query} LIMIT 1").fetchone():
                yield f"{what} {row[0]!r} is not possible"

    def _make_indexes(self) -> None:
        """Make the indexes, and remove others: one may forbid rows that are right."""
        connection = self._connection
        found = "SELECT name FROM sqlite_schema WHERE type = 'index' AND sql IS NOT NULL"
        with closing(sqlite3.connect(":memory:")) as sound:
            sound.executescript(_SCHEMA + _INDEXES)
            ours = {name for name, in sound.execute(found)}
        for name, in connection.execute(found).fetchall():
            if name not in ours:
                connection.execute('DROP INDEX "{}"'.format(name.replace('"', '""')))
        connection.executescript(_INDEXES)

    @property
    def change_count(self) -> int:
        """Rows changed since the database was opened."""
        return self._connection.total_changes

    def close(self) -> None:
        """Close; harmless when repeated."""
        self._connection.close()

    @contextmanager
    def transaction(self, *, synced: bool = True) -> Iterator[sqlite3.Connection]:
        """Make all statements within durable together, or none of them.

        Without `synced`, they survive a kill of this process at once, and a power cut only after
        the next transaction that is synced.

        Raises
        ------
        DiskFullError
            Where the disk is full.
        DamagedDatabaseError
            Where the database is malformed.
        StoreError
            Where a statement fails otherwise.
        """
        if synced and self._unsettled.is_set():
            self.settle()
        with self._translate_errors(), self._sync_mode(synced=synced):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._commit()
            except BaseException:
                self._connection.rollback()
                raise

    def _commit(self) -> None:
        try:
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            # A disk that is full did not take the end of the transaction, without which it is void.
            if _code(error) != sqlite3.SQLITE_FULL:
                self._unsettled.set()
            raise

    def settle(self) -> None:
        """Make sure that no transaction that failed is found by the next hub.

        A commit whose sync fails has its rows in the write-ahead log. SQLite forgets them here, but
        reads them when it opens the database again, unless another transaction was written in their
        place. And what the kernel could not sync it may drop without another word: so all is copied
        from the log into the database, and synced there.

        Raises as `transaction`: then nobody knows what the next hub finds.
        """
        if not self._unsettled.is_set():
            return
        self._unsettled.clear()
        settled = False
        try:
            with self.transaction() as connection:
                connection.execute(
                    "INSERT INTO meta VALUES ('settled', '1')"
                    " ON CONFLICT (name) DO UPDATE SET value = value + 1")
            settled = self.truncate_log()
        finally:
            if not settled:
                self._unsettled.set()
        if not settled:
            raise StoreError(f"{self.path.name}: another program reads it")

    @contextmanager
    def _sync_mode(self, *, synced: bool) -> Iterator[None]:
        if synced:  # FULL, as set by `_open`
            yield
            return
        # SQLite copies a long log into the database after a commit and does not say where that
        # fails: a sync that failed, of what was not synced before, would go unseen.
        self._connection.executescript("PRAGMA synchronous=NORMAL; PRAGMA wal_autocheckpoint=0")
        try:
            yield
        finally:
            self._connection.executescript(
                f"PRAGMA synchronous=FULL; PRAGMA wal_autocheckpoint={_LOG_PAGES}")

    def execute(
        self, statement: str, *values: str | float | None, synced: bool = True
    ) -> list[sqlite3.Row]:
        """Run one statement in a transaction of its own and give its rows."""
        with self.transaction(synced=synced) as connection:
            return connection.execute(statement, values).fetchall()

    def select(self, statement: str, *values: str | float | None) -> list[sqlite3.Row]:
        """Run one query and give its rows."""
        with self._translate_errors():
            return self._connection.execute(statement, values).fetchall()

    def select_ids(self, statement: str, *values: str | float | None) -> list[str]:
        """Run one query and give its column `capture_id`."""
        return [row["capture_id"] for row in self.select(statement, *values)]

    def select_one(self, statement: str, *values: str | float | None) -> sqlite3.Row | None:
        """Run one query and give its first row, None where there is none."""
        with self._translate_errors():
            cursor = self._connection.execute(statement, values)
            row: sqlite3.Row | None = cursor.fetchone()
            cursor.close()  # else its read transaction stays open
        return row

    def meta(self, name: str) -> str | None:
        """Give a value of the table `meta`, None where there is none."""
        row = self.select_one("SELECT value FROM meta WHERE name = ?", name)
        return row["value"] if row else None

    def set_meta(self, name: str, value: str) -> None:
        """Set a value of the table `meta`."""
        self.execute("INSERT INTO meta VALUES (?, ?)"
                 " ON CONFLICT (name) DO UPDATE SET value = excluded.value", name, value)

    def skip_sequence_numbers(self, count: int) -> None:
        """Leave out the next `count` sequence numbers of outcomes."""
        with self.transaction() as connection:
            connection.execute(
                "INSERT INTO sqlite_sequence SELECT 'outcomes', 0 WHERE NOT EXISTS"
                " (SELECT * FROM sqlite_sequence WHERE name = 'outcomes')")
            connection.execute(
                "UPDATE sqlite_sequence SET seq = seq + ? WHERE name = 'outcomes'", (count,))

    def truncate_log(self) -> bool:
        """Empty the write-ahead log, which still holds rows that were deleted.

        False where another program reads the database: the log stays until it has ended that.
        """
        # First without the writer's lock; what is left to do under it is quick then.
        self.select_one("PRAGMA wal_checkpoint(PASSIVE)")
        # SQLite would hold that lock while it waits for readers.
        self.select_one("PRAGMA busy_timeout = 0")
        try:
            for _ in range(_LOG_TRIES):
                row = self.select_one("PRAGMA wal_checkpoint(TRUNCATE)")
                if row is not None and not row[0]:
                    return True
                time.sleep(_LOG_PAUSE_S)
        finally:
            self.select_one(f"PRAGMA busy_timeout = {_BUSY_S * 1000:.0f}")
        return False

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            code = _code(error)
            if code == sqlite3.SQLITE_IOERR_FSYNC:
                self._unsettled.set()
            reason = f"{self.path.name}: {error}"
            if code in _DAMAGE or code & 0xFF in _DAMAGE:
                raise DamagedDatabaseError(reason) from error
            if code & 0xFF == sqlite3.SQLITE_FULL:
                raise DiskFullError(f"no room on the disk ({reason})") from error
            raise StoreError(reason) from error
        except UnicodeDecodeError as error:  # from a damaged name in SQLite's message
            raise DamagedDatabaseError(f"{self.path.name}: malformed") from error


def _sync_again(path: Path) -> None:
    """Write what a file holds once more, and sync it.

    Where a sync failed before the last hub was killed, the kernel takes for written what is on no
    disk, and rows that follow it in the log would be lost with it.
    """
    descriptor, at = os.open(path, os.O_RDWR | os.O_CLOEXEC), 0
    try:
        while chunk := os.pread(descriptor, _CHUNK_BYTES, at):
            at += os.pwrite(descriptor, chunk, at)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _schema(connection: sqlite3.Connection) -> set[tuple[str, str]]:
    """Give name and definition of all but indexes, and what SQLite makes for itself."""
    return {(name, " ".join(definition.split())) for name, definition in connection.execute(
        "SELECT name, sql FROM sqlite_schema WHERE type != 'index' AND name NOT GLOB 'sqlite_*'")}


def _code(error: sqlite3.Error) -> int:
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)
