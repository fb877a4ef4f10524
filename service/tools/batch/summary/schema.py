"""The columns of `summary.parquet`, what each means, and rows as batches of columns."""

import json
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import pyarrow as pa

from denseface.service.tools.batch.row import Row

__all__ = ["COLUMNS", "KEY", "SCHEMA", "Column", "rows_of", "to_batch"]


class Column(NamedTuple):
    """A column of the table."""

    name: str
    type: pa.DataType
    meaning: str
    unit: str = ""
    nullable: bool = False


COLUMNS = (
    Column("source", pa.string(), "File or folder that the frame is in, as it was given"),
    Column("frame", pa.int32(), "Number in the source, from 0; null where that could not be opened",
           nullable=True),
    Column("state", pa.string(), "face, no_face, unreadable or failed"),
    Column("output", pa.string(), "File of the face, relative to the summary's folder",
           nullable=True),
    Column("error", pa.string(), "Class of the error; empty where there was none"),
    Column("why", pa.string(), "Why there is no face; empty where there is one"),
    Column("measured", pa.int32(), "Points that the sensor measured on the face", nullable=True),
    Column("dense", pa.int32(), "Points of the dense face", nullable=True),
    Column("sigma_mm", pa.float64(), "Median standard error of the dense points", "mm",
           nullable=True),
    Column("mean_spacing_mm", pa.float64(), "Mean distance of neighbouring measured points", "mm",
           nullable=True),
    Column("noise_mm", pa.float64(), "Standard deviation of the noise of depth", "mm",
           nullable=True),
    Column("face_score", pa.float64(), "How sure it is that this is a face, 0-1", nullable=True),
    Column("seconds", pa.float64(), "Wall time that the frame took its worker", "s"),
    Column("worker", pa.string(), "Worker that had it last"),
    Column("attempts", pa.int32(), "How often it was tried"),
    Column("warnings", pa.list_(pa.field("element", pa.string(), nullable=False)),
           "Of the face's report"),
    Column("thumbnail", pa.binary(), "A small picture, JPEG or WebP", nullable=True),
)
KEY = "source", "frame"
"""No two rows have both in common; the file is sorted by them, null first."""
SCHEMA = pa.schema(
    [pa.field(one.name, one.type, one.nullable, {"meaning": one.meaning, "unit": one.unit})
     for one in COLUMNS],
    {"denseface.columns": json.dumps(
        {one.name: {"meaning": one.meaning, "unit": one.unit} for one in COLUMNS})})
"""What readers of Arrow find at the fields is in the file's own metadata, too, for others."""
_OF_FACES = "measured", "dense"
"""Null in the file where there is no face, so that no average counts a 0."""


def to_batch(rows: Iterable[Row]) -> pa.RecordBatch:
    """Give rows as columns."""
    return pa.RecordBatch.from_pylist([_columns(row) for row in rows], SCHEMA)


def _columns(row: Row) -> dict[str, Any]:
    values = row.as_dict()
    values["thumbnail"] = row.thumbnail or None
    if row.state != "face":
        values |= dict.fromkeys(_OF_FACES)
    return values


def rows_of(batch: pa.RecordBatch | pa.Table) -> Iterator[Row]:
    """Read rows from columns; FormatError where one of them is none."""
    for values in batch.to_pylist():
        values["warnings"] = tuple(values["warnings"])
        values["thumbnail"] = values["thumbnail"] or b""
        for name in _OF_FACES:
            values[name] = values[name] or 0
        yield Row.from_dict(values)
