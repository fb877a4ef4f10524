"""Recordings as faulty recorders leave them: the records of a good one, edited."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from denseface.capture.oni.records import FRAME, HEAD, HEADER, MAGIC, Kind

__all__ = ["Record", "began_late", "edited", "records_of", "without_cropping"]


class Record(NamedTuple):
    """A record of an `.oni` file."""

    kind: int
    node: int
    fields: bytes
    payload: bytes

    def __bytes__(self) -> bytes:
        head = HEAD.pack(MAGIC, self.kind, self.node, HEAD.size + len(self.fields),
                         len(self.payload), 0)
        return head + self.fields + self.payload


def records_of(content: bytes) -> Iterator[Record]:
    """Give the records of a whole file."""
    at = HEADER.size
    while at < len(content):
        _, kind, node, size, payload, _ = HEAD.unpack_from(content, at)
        fields, at = content[at + HEAD.size:at + size], at + size + payload
        yield Record(kind, node, fields, content[at - payload:at])
        if kind == Kind.END:
            break


def edited(content: bytes, edit: Callable[[Record], Iterable[Record]]) -> bytes:
    """Give a file with each record replaced; without tables, whose positions would be wrong."""
    parts = [content[:HEADER.size]]
    for record in records_of(content):
        if record.kind == Kind.NODE_ADDED:
            parts.append(bytes(record._replace(fields=record.fields[:-8] + bytes(8))))
        elif record.kind != Kind.SEEK_TABLE:
            parts += map(bytes, edit(record))
    return b"".join(parts)


def without_cropping(content: bytes) -> bytes:
    """Give a file as a driver that does not know the Cropping property makes it."""
    return edited(content, lambda record: () if b"Cropping\0" in record.fields else (record,))


def began_late(content: bytes, node: int, frames: int) -> bytes:
    """Give a file in which a stream began so many frames late, its stamps from 0 all the same."""
    first: list[int] = []
    seen = 0

    def edit(record: Record) -> Iterator[Record]:
        nonlocal seen
        if record.kind == Kind.NEW_DATA and record.node == node:
            seen += 1
            if seen <= frames:
                return
            stamp, number = FRAME.unpack(record.fields)
            first.append(stamp)
            record = record._replace(fields=FRAME.pack(stamp - first[0], number - frames))
        yield record

    return edited(content, edit)
