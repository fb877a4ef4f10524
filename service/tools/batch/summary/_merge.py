"""Sorted tables become one, in which of rows of the same frame the last stays."""

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from denseface.service.tools.batch.summary.schema import KEY, SCHEMA

__all__ = ["GONE", "key_at", "merged", "only_last"]

GONE = "gone"
"""State of a row that takes away what an earlier file has of its key."""
_STEP_ROWS = 16_384
"""Rows that are taken of all sources together at a time, unless a source has fewer."""
_ORDER = "#"
"""Column by which the later of two rows of a frame is known."""


def key_at(table: pa.Table, row: int) -> tuple[str, int]:
    """Give a row's key, so that it compares as the table is sorted: a null is -1."""
    source, frame = (table.column(name)[row].as_py() for name in KEY)
    return source, -1 if frame is None else frame


def only_last(table: pa.Table) -> pa.Table:
    """Sort rows that are in the order in which they came, and keep the last of each frame."""
    return _distinct(table.append_column(_ORDER, pa.array(np.arange(len(table)))))


def merged(sources: Sequence[Iterator[pa.Table]]) -> Iterator[pa.Table]:
    """Merge tables, each source sorted and with each frame once; the later source wins.

    In memory is the table that each source gave last. Rows of state `GONE` are left out.
    """
    heads = [_Head(source, _STEP_ROWS // max(len(sources), 1)) for source in sources]
    while waiting := [head.reach() for head in heads if head.fill()]:
        bound = min(waiting)
        parts = [part.append_column(_ORDER, pa.array(np.full(len(part), order)))
                 for order, part in enumerate(head.take(bound) for head in heads) if len(part)]
        one = pa.concat_tables(parts)
        rows = _distinct(one) if len(parts) > 1 else one.drop_columns(_ORDER)
        yield rows.filter(pc.not_equal(rows.column("state"), GONE))


class _Head:
    """What is next of a sorted source."""

    def __init__(self, tables: Iterator[pa.Table], step: int) -> None:
        self._tables, self._step = tables, max(step, 256)
        self._table = SCHEMA.empty_table()
        self._at = 0

    def fill(self) -> bool:
        """Read on where all is taken; False at the end."""
        while self._at >= len(self._table):
            table = next(self._tables, None)
            if table is None:
                self._table, self._at = SCHEMA.empty_table(), 0
                return False
            self._table, self._at = table.replace_schema_metadata(SCHEMA.metadata), 0
        return True

    def reach(self) -> tuple[str, int]:
        """Give the key up to which may be taken at once."""
        return key_at(self._table, min(self._at + self._step, len(self._table)) - 1)

    def take(self, bound: tuple[str, int]) -> pa.Table:
        """Take what is not behind a key."""
        low, high = self._at, len(self._table)
        while low < high:
            middle = (low + high) // 2
            if key_at(self._table, middle) <= bound:
                low = middle + 1
            else:
                high = middle
        part = self._table.slice(self._at, low - self._at)
        self._at = low
        return part


def _distinct(table: pa.Table) -> pa.Table:
    # A null is below all frames: where it stands is said otherwise in pyarrow 18 than in 26.
    keys = pa.table({"source": table.column("source"),
                     "frame": pc.fill_null(table.column("frame"), -1),
                     _ORDER: table.column(_ORDER)})
    order = pc.sort_indices(keys, sort_keys=[(name, "ascending") for name in keys.column_names])
    source, frame = (keys.column(name).take(order).combine_chunks() for name in KEY)
    last = np.ones(len(order), bool)
    last[:-1] = (np.asarray(pc.not_equal(source[:-1], source[1:]))
                 | np.asarray(pc.not_equal(frame[:-1], frame[1:])))
    return table.take(order.filter(pa.array(last))).drop_columns(_ORDER)
