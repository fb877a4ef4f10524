"""A copy of a recording that OpenNI2 can play, where it cannot play the file itself.

The library refuses a file whose header or tables promise more than there is, as where it was cut
or its recorder was killed, and drops every frame of a stream that does not say whether it is
cropped.
"""

import shutil
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.oni import records
from denseface.capture.oni.file import MAX_NODES, OniFile
from denseface.capture.oni.records import HEAD, HEADER, Kind
from denseface.files import open_regular

__all__ = ["mended", "what_is_missing"]

_SPARE_BYTES = 64 * 2**20
"""Of the folder for temporary files that are left free."""
_LEFT_OUT = (Kind.END, Kind.SEEK_TABLE, Kind.NODE_REMOVED)
"""Records that state positions or end a stream; nothing here needs them."""


def what_is_missing(found: OniFile) -> str | None:
    """Say for want of what OpenNI2 cannot play a file; None where it can."""
    missing = [f"the Cropping property of the {name} stream" for kind, name in
               ((records.DEPTH_NODE, "depth"), (records.IMAGE_NODE, "color"))
               if (node := found.node(kind)) and not node.croppable]
    if not max(found.nodes) <= found.max_node <= MAX_NODES:
        missing.append("the number of streams in its header")
    if any(node.seek_table_at >= found.end for node in found.nodes.values()):
        missing.append("the table of its frames")
    return ", ".join(missing) or None


def mended(path: Path, found: OniFile) -> BinaryIO:
    """Give a temporary copy, which is gone when closed, with what was missing.

    Raises
    ------
    UnreadableSourceError
        The file cannot be read any more, or there is no room for a copy.
    """
    folder = tempfile.gettempdir()
    free = shutil.disk_usage(folder).free
    if free < found.end + _SPARE_BYTES:
        raise UnreadableSourceError(
            f"{path}: lacks {what_is_missing(found)}; a mended copy needs {found.end >> 20} MiB "
            f"and {_SPARE_BYTES >> 20} MiB to spare in {folder}, {free >> 20} MiB are free")
    copy: BinaryIO = tempfile.TemporaryFile(prefix="denseface-")  # noqa: SIM115
    try:
        with open_regular(path) as file:
            *version, _, _ = HEADER.unpack(file.read(HEADER.size))
            copy.write(HEADER.pack(*version, records.UNKNOWN_STAMP, max(found.nodes)))
            for part in _records(file, found):
                copy.write(part)
        copy.write(records.record(Kind.END, 0))
        copy.flush()
    except (OSError, struct.error) as error:
        copy.close()
        raise UnreadableSourceError(f"{path}: cannot be mended: {error}") from error
    except BaseException:
        copy.close()
        raise
    return copy


def _records(file: BinaryIO, found: OniFile) -> Iterator[bytes]:
    """Give the whole records of a file after its header, changed as needed."""
    at = HEADER.size
    streams = {number: node for number, node in found.nodes.items()
               if node.kind in (records.DEPTH_NODE, records.IMAGE_NODE)}
    while at < found.end:
        head = file.read(HEAD.size)
        _, kind, number, fields, payload, _ = HEAD.unpack(head)
        content = file.read(fields - HEAD.size + payload)
        at += fields + payload
        if kind in _LEFT_OUT:
            continue
        if kind == Kind.NODE_ADDED:
            content = _uncounted(content)
        elif kind == Kind.STATE_READY and number in streams and not streams[number].croppable:
            yield records.cropping_properties(number)
        yield head + content


def _uncounted(fields: bytes) -> bytes:
    """Let a record that adds a node promise no number of frames and no table of them."""
    at = len(fields) - records.NODE_TAIL.size
    codec, *_ = records.NODE_TAIL.unpack_from(fields, at)
    return fields[:at] + records.NODE_TAIL.pack(
        codec, records.UNKNOWN_FRAMES, 0, records.UNKNOWN_STAMP, 0)
