"""`summary.parquet`: always whole, sorted by frame, read a row group at a time."""

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Self

import pyarrow as pa
import pyarrow.parquet as pq

from denseface.service.runtime.files import sync_folder
from denseface.service.tools.batch.summary._failing import corrupt, named
from denseface.service.tools.batch.summary._merge import key_at
from denseface.service.tools.batch.summary.schema import COLUMNS, KEY, SCHEMA

__all__ = ["GROUP_ROWS", "SummaryFile", "write_table"]

GROUP_ROWS = 4096
"""Rows of a group: some 8 MB with their pictures; what is in memory at a time."""
_FOLDED = b"denseface.folded"
"""Key of the number of the last run that is in the file."""
_PICTURES = "thumbnail"
_REPEATED = ["source", "state", "error", "why", "worker", "warnings.list.element"]
"""Columns whose values come again: a dictionary holds them once."""


class SummaryFile:
    """The file, open: it stays as it is, also where another takes its name.

    Raises
    ------
    CorruptFileError
        It is no such file, or damaged; so do all methods.
    StoreError
        It cannot be read; FileNotFoundError where there is none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with named(path):
            self._file = pa.OSFile(str(path), "rb")
            try:
                self._parquet = pq.ParquetFile(self._file, page_checksum_verification=True)
                self.folded = _folded(path, self._parquet.schema_arrow)
            except BaseException:
                self._file.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it."""
        self._file.close()

    @property
    def rows(self) -> int:
        """How many there are."""
        return int(self._parquet.metadata.num_rows)

    @property
    def size(self) -> int:
        """Bytes."""
        return int(self._file.size())

    @property
    def groups(self) -> int:
        """How many groups of rows there are."""
        return int(self._parquet.num_row_groups)

    def group(self, number: int, columns: Sequence[str] | None = None) -> pa.Table:
        """Read a group of rows, or some of its columns."""
        with named(self.path):
            return self._parquet.read_row_group(number, columns=columns, use_threads=False)

    def each_group(self, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """Read one group after the other."""
        for number in range(self.groups):
            yield self.group(number, columns)

    def firsts(self) -> list[tuple[str, int]]:
        """Give the key of each group's first row, a null as -1."""
        return [key_at(self.group(number, KEY), 0) for number in range(self.groups)]


def _folded(path: Path, schema: pa.Schema) -> int:
    """Read the number of the last run in a file; CorruptFileError where it is none of ours."""
    said = (schema.metadata or {}).get(_FOLDED, b"")
    if not schema.equals(SCHEMA):
        raise corrupt(path, "other columns")
    if not said.isdigit() or len(said) > 18:
        raise corrupt(path, "no number of runs")
    return int(said)


def write_table(
    path: Path, temporary: Path, tables: Iterable[pa.Table], folded: int,
) -> tuple[int, int]:
    """Write tables, in their order, as the file of this name; give its bytes and its rows.

    The old file, or all of the new, has the name, whatever happens meanwhile.

    Raises
    ------
    StoreError
        It cannot be written; DiskFullError where the disk is full.
    """
    schema = SCHEMA.with_metadata({**SCHEMA.metadata, _FOLDED: str(folded).encode()})
    plain: dict[str, Any] = {one.name: "zstd" for one in COLUMNS}
    plain["warnings.list.element"] = plain.pop("warnings")
    rows = 0
    with named(path):
        try:
            with temporary.open("wb") as file:
                with pq.ParquetWriter(
                        file, schema, compression=plain | {_PICTURES: "none"},
                        use_dictionary=_REPEATED, write_page_checksum=True,
                        # Of pictures and reasons they would only be long.
                        write_statistics=[name for name in plain if name not in (
                            "why", _PICTURES)],
                        sorting_columns=pq.SortingColumn.from_ordering(
                            schema, [(name, "ascending") for name in KEY], "at_start"),
                ) as writer:
                    for table in _of_size(tables):
                        rows += len(table)
                        writer.write_table(table.cast(schema), row_group_size=GROUP_ROWS)
                size = _synced(file)
            temporary.replace(path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
        sync_folder(path.parent)
    return size, rows


def _synced(file: BinaryIO) -> int:
    """Wait until a file is on the disk, and give its bytes; OSError where it is not all there."""
    file.flush()
    os.fsync(file.fileno())
    size = file.tell()
    if os.fstat(file.fileno()).st_size != size:
        raise OSError(errno.EIO, "was not written whole")
    return size


def _of_size(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Join small tables, and cut large ones, to groups of the same size."""
    kept: list[pa.Table] = []
    count = 0
    for table in tables:
        kept.append(table)
        count += len(table)
        if count >= GROUP_ROWS:
            whole = pa.concat_tables(kept)
            for at in range(0, count - GROUP_ROWS + 1, GROUP_ROWS):
                yield whole.slice(at, GROUP_ROWS)
            kept = [whole.slice(count - count % GROUP_ROWS)]
            count %= GROUP_ROWS
    if count:
        yield pa.concat_tables(kept)

