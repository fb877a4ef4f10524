"""The rows of an archive in a file that is whole at every moment, however the run ends."""

import time
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple, Self

import pyarrow as pa

from denseface.files import make_folder, write_whole
from denseface.service.tools.batch.row import Row, State, told
from denseface.service.tools.batch.summary._failing import corrupt, named
from denseface.service.tools.batch.summary._journal import Journal, read_stream
from denseface.service.tools.batch.summary._merge import GONE, merged, only_last
from denseface.service.tools.batch.summary._table import GROUP_ROWS, SummaryFile, write_table
from denseface.service.tools.batch.summary.schema import KEY, to_batch

__all__ = ["SUMMARY", "WORKSHOP", "Known", "SummaryWriter"]

SUMMARY = "summary.parquet"
WORKSHOP = ".summary"
"""Folder of what is not in the file yet; gone after a run."""
_SHARE = 4
"""The file is written anew when what is not in it has a so many-th of its rows ..."""
_MOST_RUNS = 64
"""... or as many runs as this, which all are open then ..."""
_SMALL_BYTES, _FRESH_S = 8 * 2**20, 10.0
"""... or, where it has fewer bytes than that, so many seconds after the last time."""
_KEPT_GROUPS = 8
"""Groups of rows of which the keys are kept in memory."""


class Known(NamedTuple):
    """What earlier runs made of a frame."""

    state: State
    output: str | None
    """File of the face, relative to the folder; whether it is there is not known."""
    error: str
    """Class of the error; empty where there was none."""
    attempts: int


class SummaryWriter:
    """Writes `summary.parquet` in a folder, row by row, on top of what earlier runs wrote.

    For one process at a time, and one thread. The file is replaced as a whole, ever more seldom, so
    that all the writing is a small multiple of its size; what it does not have yet is in a folder
    `.summary` beside it, and the next writer, however this one ended, puts it in. A row that was
    added is not lost by a kill.

    Parameters
    ----------
    folder : made where it is missing

    Raises
    ------
    UsageError
        Another process writes there.
    CorruptFileError
        `summary.parquet` is something else.
    StoreError
        The folder cannot be read or written; DiskFullError where the disk is full. So do all
        methods; what was written stays readable.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / SUMMARY
        self._workshop = folder / WORKSHOP
        with named(self._workshop):
            make_folder(self._workshop)
        self._journal = Journal(self._workshop / "journal.arrows")
        self._count = 0
        """Rows in the journal."""
        self._in_runs = 0
        """Rows in the runs."""
        try:
            self._recover()
            self._earlier = _Earlier(SummaryFile(self.path))
        except BaseException:
            self._journal.close()
            raise
        self._gone: set[str] = set()
        """Sources that could not be opened before, and now could."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def earlier(self) -> dict[State, int]:
        """How many frames of each state earlier runs left."""
        return self._earlier.counts

    def known(self, source: str, frame: int | None) -> Known | None:
        """Say what earlier runs made of a frame; None where they did not have it.

        Takes a few microseconds where sources come in the order of their names, else up to some
        milliseconds; the memory that it needs does not grow with the rows.
        """
        return self._earlier.known(told(source), frame)

    def add(self, *rows: Row) -> None:
        """Keep rows; of rows of the same frame the last.

        Several at once are cheaper than one by one. When this returns they survive the process.
        """
        if not rows:
            return
        batch = to_batch(rows)
        if gone := self._reopened(rows):
            state = batch.schema.get_field_index("state")
            away = to_batch(gone)
            away = away.set_column(state, batch.schema.field(state), pa.array([GONE] * len(gone)))
            self._journal.append(away)
            self._count += len(gone)
        self._journal.append(batch)
        self._count += len(rows)
        small = self._size < _SMALL_BYTES and time.monotonic() - self._folded_s >= _FRESH_S
        if small:
            self._fold()
        elif self._count >= GROUP_ROWS:
            runs = len(self._runs()) + 1
            if runs >= _MOST_RUNS or self._in_runs + self._count >= self._rows // _SHARE:
                self._fold()
            else:
                self._make_run()

    def close(self) -> None:
        """Put all rows into the file, and take away what else there is."""
        if self._earlier.closed:
            return
        self._earlier.close()
        removed = False
        try:
            if self._count or self._in_runs:
                self._fold()
            removed = True
        finally:
            self._journal.close(remove=removed)
            with suppress(OSError):
                self._workshop.rmdir()

    def _reopened(self, rows: tuple[Row, ...]) -> list[Row]:
        """Give rows of sources that could not be opened by an earlier run, and are read now."""
        found: list[Row] = []
        for row in rows:
            if (row.frame is not None and row.source not in self._gone
                    and self.known(row.source, None) is not None):
                self._gone.add(row.source)
                found.append(row.model_copy(update={"frame": None, "output": None}))
        return found

    def _runs(self) -> list[tuple[int, Path]]:
        return sorted((int(path.stem[4:]), path) for path in self._workshop.glob("run-*.arrow")
                      if path.stem[4:].isdigit())

    def _recover(self) -> None:
        """Put into the file what an earlier process did not, or make an empty one."""
        self._folded = self._rows = self._size = 0
        self._folded_s = time.monotonic()
        there = self.path.exists() or self.path.is_symlink()
        if there:
            with SummaryFile(self.path) as file:
                self._folded, self._rows, self._size = file.folded, file.rows, file.size
        number, rows = self._journal.read()
        runs = self._runs()
        self._count = len(rows) if number > self._folded else 0
        self._in_runs = sum(1 for run, _ in runs if run > self._folded)
        self._number = max(self._folded, number, *(run for run, _ in runs), 0)
        if self._count or self._in_runs or not there:
            self._fold()
        else:
            self._clear()

    def _make_run(self) -> None:
        """Bring the journal's rows in order, into a file of their own."""
        path = self._workshop / f"run-{self._number}.arrow"
        with named(path):
            rows = only_last(self._journal.read()[1]).combine_chunks()
            sink = pa.BufferOutputStream()
            head = rows.schema.with_metadata({b"denseface.run": str(self._number).encode()})
            with pa.ipc.new_stream(sink, head) as writer:
                writer.write_table(rows)
            write_whole(path, [memoryview(sink.getvalue())], folders=False)
        self._in_runs += len(rows)
        self._count = 0
        self._number += 1
        self._journal.begin(self._number)

    def _fold(self) -> None:
        """Write the file anew with all that it does not have."""
        with ExitStack() as opened:
            sources: list[Iterator[pa.Table]] = []
            if self.path.exists():
                sources.append(opened.enter_context(SummaryFile(self.path)).each_group())
            for number, path in self._runs():
                if number > self._folded:
                    sources.append(iter([_read_run(path)]))
            if self._count:
                sources.append(iter([only_last(self._journal.read()[1])]))
            self._size, self._rows = write_table(
                self.path, self._workshop / "new.parquet", merged(sources), self._number)
        self._folded = self._number
        self._clear()
        self._folded_s = time.monotonic()

    def _clear(self) -> None:
        """Take away what is in the file, and begin anew."""
        for _, path in self._runs():
            with named(path):
                path.unlink()
        with named(self._workshop):
            (self._workshop / "new.parquet").unlink(missing_ok=True)
        for path in self._workshop.glob(".*.tmp"):  # of a run that was being written
            with suppress(OSError):
                path.unlink()
        self._count = self._in_runs = 0
        self._number = self._folded + 1
        self._journal.begin(self._number)


def _read_run(path: Path) -> pa.Table:
    """Read a run without having it in memory."""
    with named(path), pa.memory_map(str(path)) as data:
        number, rows = read_stream(data.read_buffer())
    if not number:
        raise corrupt(path, "no rows")
    return rows


class _Earlier:
    """Looks frames up in the file as it was at the beginning."""

    def __init__(self, file: SummaryFile) -> None:
        self._file = file
        self._firsts = file.firsts()
        self._groups: OrderedDict[int, dict[tuple[str, int | None], Known]] = OrderedDict()
        self.counts: dict[State, int] = {}
        self.closed = False
        for table in file.each_group(["state"]):
            for one in table.column("state").value_counts().to_pylist():
                self.counts[one["values"]] = self.counts.get(one["values"], 0) + one["counts"]

    def known(self, source: str, frame: int | None) -> Known | None:
        number = bisect_right(self._firsts, (source, -1 if frame is None else frame)) - 1
        if number < 0:
            return None
        if number in self._groups:
            self._groups.move_to_end(number)
        else:
            names = *KEY, *Known._fields
            columns = self._file.group(number, names).select(names).to_pydict().values()
            self._groups[number] = {
                (source, frame): Known(*rest)
                for source, frame, *rest in zip(*columns, strict=True)}
            if len(self._groups) > _KEPT_GROUPS:
                self._groups.popitem(last=False)
        return self._groups[number].get((source, frame))

    def close(self) -> None:
        self.closed = True
        self._groups.clear()
        self._file.close()
