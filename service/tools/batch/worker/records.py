"""What was made of each frame, in a small file of its own: what a batch that is begun again skips.

Workers write a record when the face's files are whole, each for itself: nothing is gathered, and
nothing is lost with the process that started the batch. That a file is there is not enough: its
size must be the one that was written, and the source the one that was read.
"""

import base64
import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from denseface.files import read_bounded, write_whole
from denseface.service.errors import FormatError
from denseface.service.tools.batch.row import Row
from denseface.service.tools.reconstruction.inputs import SIDE

__all__ = ["FACES", "RECORDS", "Origin", "Record", "read_record", "write_record"]

FACES, RECORDS = "faces", "records"
"""Folders of a batch's folder."""
_MAX_BYTES = 1 << 16
_KEPT = "face", "no_face"
"""States that another try would not change."""


class Record(NamedTuple):
    """A frame that is done."""

    row: Row
    total: int | None
    """Frames of its source, at most; None where that is not known."""


class Origin(NamedTuple):
    """A source as it was found."""

    source: str
    """File or folder, absolute."""
    stamp: tuple[int, ...]
    """Changes where the source, or the calibration beside it, does; empty where there is none."""

    @classmethod
    def of(cls, source: str) -> "Origin":
        """Look at a source."""
        stamp: tuple[int, ...] = ()
        for path in (Path(source), Path(source).with_suffix(SIDE)):
            with suppress(OSError, ValueError):
                status = path.stat()
                stamp += status.st_size, status.st_mtime_ns
        return cls(source, stamp)


def write_record(
    folder: Path, name: str, record: Record, origin: Origin, files: Iterable[Path]
) -> None:
    """Keep what became of a frame, and which files are whole; OSError as from the system.

    Parameters
    ----------
    folder : of the batch
    name : of the frame's files, below the folder of faces, without ending
    """
    row = record.row
    if row.state not in _KEPT:
        return
    text = json.dumps({
        "source": origin.source, "stamp": origin.stamp, "total": record.total,
        "row": row.as_dict() | {"thumbnail": base64.b64encode(row.thumbnail).decode()},
        "files": {path.relative_to(folder).as_posix(): path.stat().st_size for path in files}})
    # Not synced: where the system fails, a record that is damaged is none.
    write_whole(_path(folder, name), [text.encode()], synced=False)


def read_record(folder: Path, name: str, origin: Origin) -> Record | None:
    """Give what became of a frame; None where that is not known, or no longer true."""
    try:
        given = json.loads(read_bounded(_path(folder, name), _MAX_BYTES))
        if (given["source"], tuple(given["stamp"])) != origin:
            return None
        for path, size in given["files"].items():
            if (folder / path).stat().st_size != size:
                return None
        row = given["row"] | {"thumbnail": base64.b64decode(given["row"]["thumbnail"])}
        return Record(Row.from_dict(row), given["total"])
    except (OSError, FormatError, LookupError, TypeError, ValueError, AttributeError):
        return None


def _path(folder: Path, name: str) -> Path:
    return folder / RECORDS / f"{name}.json"
