"""What an `.oni` file holds, found before OpenNI2 may see it.

OpenNI2 reports all damage as one bare error, or delivers fewer frames and then none. It does not
say that OpenNI 1 recorded depth in the colour camera's pixels, nor in which order the frames were
recorded. The records tell all of that.
"""

import os
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from denseface.capture.errors import UnreadableSourceError
from denseface.capture.oni.records import (
    DEPTH_NODE,
    DESCRIPTION,
    FRAME,
    HEAD,
    HEADER,
    IMAGE_NODE,
    MAGIC,
    MAX_STAMP_US,
    MODE,
    NODE_ADDED,
    NODE_TAIL,
    PROPERTIES,
    U32,
    Kind,
)
from denseface.files import open_regular

__all__ = ["MAX_NODES", "OniFile", "OniNode", "read_oni"]

_MODE = "xnMapOutputMode"
"""Property that holds the size of the images."""
_KEPT = ("xnCropping", "oniOriginalDevice", "DeviceName", "ID", "USBPath", DESCRIPTION)
"""Properties that are not whole numbers, and are asked for."""
_MAX_FIELDS = 1 << 20
"""Bytes of a record's fields; more is damage."""
MAX_NODES, _MAX_PROPERTIES, _MAX_NAME_BYTES = 64, 1024, 256
"""Nodes of a file, and the largest number of one, properties of one and bytes of a name; more is
damage. A sensor has three nodes, of some thirty properties each."""


@dataclass
class OniNode:
    """One stream of a recording, or the device."""

    kind: int
    """DEPTH_NODE, IMAGE_NODE, or something else."""
    frames: int = 0
    """How many frame records the file holds."""
    properties: dict[str, int] = field(default_factory=dict)
    """The whole-number properties."""
    texts: dict[str, bytes] = field(default_factory=dict)
    """Those of the others that are in `_KEPT`."""
    sides: tuple[int, int] | None = None
    """Width and height of the images, pixels; None where the file does not say."""
    seek_table_at: int = 0
    """Where the table of its frames should be; 0 for none."""

    @property
    def registered(self) -> bool:
        """Whether it was recorded in another camera's pixels (`AlternativeViewPoint`)."""
        return self.properties.get("AlternativeViewPoint", 0) == 1

    @property
    def croppable(self) -> bool:
        """Whether it says if images are cropped: else OpenNI2's player drops every frame."""
        return "xnCropping" in self.texts


@dataclass
class OniFile:
    """What a recording holds."""

    end: int = HEADER.size
    """Where its last whole record ends, bytes: a recorder may leave empty space behind it."""
    cut: str | None = None
    """Why the file has no end record; None where it has one."""
    max_node: int = 0
    """The largest number of a node, as the header has it."""
    nodes: dict[int, OniNode] = field(default_factory=dict)
    order: bytearray = field(default_factory=bytearray)
    """The kind of node of each frame, in the order of the file."""
    stamps_us: "array[int]" = field(default_factory=lambda: array("Q"))
    """The stamp of each frame in the same order, microseconds."""

    def node(self, kind: int) -> OniNode | None:
        """Give the stream of a kind."""
        return next((node for node in self.nodes.values() if node.kind == kind), None)


def read_oni(path: Path) -> OniFile:
    """Walk through a recording's records.

    A file that was cut, as where a recorder was killed or a disk full, holds the frames before.

    Raises
    ------
    UnreadableSourceError
        The file is missing, not an `.oni`, or damaged before the first frame.
    """
    found = OniFile()
    try:
        with open_regular(path) as file:
            _walk(path, file, found)
    except _DamageError as error:
        if not found.order:
            raise UnreadableSourceError(f"{path}: {error}") from error
        found.cut = str(error)
    except UnreadableSourceError:
        raise
    except OSError as error:
        raise UnreadableSourceError(f"{path}: {error.strerror or error}") from error
    return found


class _DamageError(Exception):
    """What is wrong with a record; those before it are whole."""


def _walk(name: Path, file: BinaryIO, found: OniFile) -> None:
    """Fill in what the records say, up to the end record."""
    size = os.fstat(file.fileno()).st_size
    header = file.read(HEADER.size)
    if not header:
        raise UnreadableSourceError(f"{name}: the file is empty")
    if header[:2] != b"NI":
        raise UnreadableSourceError(
            f"{name}: not an .oni recording: starts with {header[:4]!r}, expected b'NI10'")
    if len(header) == HEADER.size:
        found.max_node = HEADER.unpack(header)[-1]
    while True:
        raw = file.read(HEAD.size)
        if len(raw) < HEAD.size:
            raise _DamageError(f"ends after {size} bytes without an end record: cut off, or the "
                          "recorder was not closed")
        magic, kind, node, fields, payload, _ = HEAD.unpack(raw)
        body = fields - HEAD.size
        if magic != MAGIC or not 0 <= body <= _MAX_FIELDS:
            raise _DamageError(f"damaged at byte {found.end}: no valid record there")
        if kind == Kind.END:
            found.end += fields + payload
            return
        content = file.read(body)
        after = file.seek(found.end + fields + payload)
        if after > size:
            raise _DamageError(
                f"ends after {size} bytes in the middle of a record that needs {after}")
        _note(found, kind, node, content)
        found.end = after


def _note(found: OniFile, kind: int, number: int, content: bytes) -> None:
    known = found.nodes.get(number)
    if kind in NODE_ADDED:
        tail = _text(content)[1]
        node = found.nodes[number] = OniNode(int.from_bytes(tail[:U32.size], "little"))
        if kind == Kind.NODE_ADDED and len(tail) == U32.size + NODE_TAIL.size:
            node.seek_table_at = NODE_TAIL.unpack_from(tail, U32.size)[-1]
    elif kind in PROPERTIES:
        key, value = _text(content)
        if known is None:
            return
        if kind == Kind.INT:
            known.properties[key] = int.from_bytes(value[U32.size:][:8], "little")
        elif key in _KEPT:
            known.texts[key] = value[U32.size:]
        if key == _MODE and len(value) >= U32.size + 8:
            known.sides = MODE.unpack_from(value.ljust(U32.size + MODE.size, b"\0"), U32.size)[:2]
    elif kind == Kind.NEW_DATA and known:
        if known.kind in (DEPTH_NODE, IMAGE_NODE):
            stamp_us = FRAME.unpack_from(content)[0] if len(content) >= FRAME.size else MAX_STAMP_US
            if stamp_us >= MAX_STAMP_US:
                raise _DamageError("damaged: a frame has no time stamp")
            found.order.append(known.kind)
            found.stamps_us.append(stamp_us)
        known.frames += 1
    if (max(found.nodes, default=0) > MAX_NODES
            or (known and len(known.properties) + len(known.texts) > _MAX_PROPERTIES)):
        raise _DamageError("damaged: more nodes or properties than a sensor has")


def _text(content: bytes) -> tuple[str, bytes]:
    """Split a counted, zero-ended string from what follows it."""
    length = U32.unpack_from(content)[0] if len(content) >= U32.size else 0
    end = U32.size + length
    text = content[U32.size:end].decode("latin-1")
    # OpenNI2 crashes on a byte outside ASCII: it indexes a hash table with it, signed.
    if (end > len(content) or length > _MAX_NAME_BYTES or text[-1:] != "\0"
            or not text.isascii() or not text[:-1].isprintable()):
        raise _DamageError("damaged: a record has no valid name")
    return text[:-1], content[end:]
