r"""The record structure of an `.oni` file: what is read of it before OpenNI2 may see the file.

OpenNI2 reports all damage as one bare error, or delivers fewer frames and then none. It does not
say that OpenNI 1 recorded depth in the colour camera's pixels. The records tell both. They follow a
file header; each is ``NIR\0``, uint32 type, node, size of fields, size of payload, uint64 undo
position, fields, payload; all little-endian.
"""

import os
import struct
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from denseface.capture.errors import UnreadableSourceError
from denseface.files import open_regular

DEPTH_NODE, IMAGE_NODE = 2, 3
"""Kinds of node, as in a record that adds one."""

_HEADER = struct.Struct("<4sBBHIQI")
"""Of the file."""
_RECORD = struct.Struct("<4s4IQ")
"""Start of a record, see above."""
_U32 = struct.Struct("<I")
_NODE_ADDED = (0x02, 0x0C, 0x0D)
"""Types of record that add a node."""
_PROPERTIES, _INT_PROPERTY = (0x03, 0x04, 0x05, 0x06), 0x03
"""Types of record that set a property, and the one of these for a whole number."""
_NEW_DATA, _END = 0x0A, 0x0B
"""Types of record that hold a frame and that end the file."""
_MODE = "xnMapOutputMode"
"""Property that holds the size of the images."""
_MODE_VALUE = struct.Struct("<III")
"""Its size, then width and height."""
_MAX_FIELDS = 1 << 20
"""Bytes of a record's fields; more is damage."""
_MAX_NODES, _MAX_PROPERTIES, _MAX_NAME_BYTES = 64, 1024, 256
"""Nodes of a file, properties of one of them and bytes of a name; more is damage. A sensor has
three nodes, of some thirty properties each."""


@dataclass
class OniNode:
    """One stream of a recording, or the device."""

    kind: int
    """DEPTH_NODE, IMAGE_NODE, or something else."""
    frames: int = 0
    """How many frame records the file holds."""
    properties: dict[str, int] = field(default_factory=dict)
    """The whole-number properties."""
    sides: tuple[int, int] | None = None
    """Width and height of the images, pixels; None where the file does not say."""

    @property
    def registered(self) -> bool:
        """OpenNI 1 recorded this in another camera's pixels (`AlternativeViewPoint`)."""
        return self.properties.get("AlternativeViewPoint", 0) == 1


def check_oni(path: Path) -> tuple[list[OniNode], int]:
    """Walk through a recording's records.

    Returns
    -------
    the nodes, and where the last record ends: a recorder may leave empty space behind it

    Raises
    ------
    UnreadableSourceError
        The file is missing, not an `.oni`, damaged, or was never finished.
    """
    nodes: dict[int, OniNode] = {}
    try:
        with open_regular(path) as file:
            end = _walk(path, file, nodes)
    except UnreadableSourceError:
        raise
    except OSError as error:
        raise UnreadableSourceError(f"{path}: {error.strerror or error}") from error
    return list(nodes.values()), end


def written_frames(path: Path) -> int:
    """Count the frames of each stream, at least, in a file that is still being recorded.

    0 where there is no depth or no colour stream.
    """
    nodes: dict[int, OniNode] = {}
    with suppress(UnreadableSourceError, OSError), open_regular(path) as file:
        _walk(path, file, nodes)
    found = {node.kind: node.frames for node in nodes.values()}
    return min(found.get(DEPTH_NODE, 0), found.get(IMAGE_NODE, 0))


def _walk(name: Path, file: BinaryIO, nodes: dict[int, OniNode]) -> int:
    """Fill in the nodes; give where the end record ends."""
    size = os.fstat(file.fileno()).st_size
    header = file.read(_HEADER.size)
    if not header:
        raise UnreadableSourceError(f"{name}: the file is empty")
    if header[:2] != b"NI":
        raise UnreadableSourceError(
            f"{name}: not an .oni recording: starts with {header[:4]!r}, expected b'NI10'")
    at = _HEADER.size
    while True:
        raw = file.read(_RECORD.size)
        if len(raw) < _RECORD.size:
            raise UnreadableSourceError(f"{name}: ends after {size} bytes without an end record: "
                                        "cut off, or the recorder was not closed")
        magic, kind, node, fields, payload, _ = _RECORD.unpack(raw)
        body = fields - _RECORD.size
        if magic != b"NIR\0" or not 0 <= body <= _MAX_FIELDS:
            raise UnreadableSourceError(f"{name}: damaged at byte {at}: no valid record there")
        after: int = at + fields + payload
        if kind == _END:
            return after
        content = file.read(body)
        at = file.seek(after)
        if at > size:
            raise UnreadableSourceError(
                f"{name}: ends after {size} bytes in the middle of a record that needs {at}")
        known = nodes.get(node)
        if kind in _NODE_ADDED:
            nodes[node] = OniNode(int.from_bytes(_text(name, content)[1][:_U32.size], "little"))
        elif kind in _PROPERTIES:
            key, value = _text(name, content)
            if kind == _INT_PROPERTY and known:
                known.properties[key] = int.from_bytes(value[_U32.size:][:8], "little")
            elif key == _MODE and known and len(value) >= _MODE_VALUE.size:
                known.sides = _MODE_VALUE.unpack_from(value)[1:]
        elif kind == _NEW_DATA and known:
            known.frames += 1
        if len(nodes) > _MAX_NODES or (known and len(known.properties) > _MAX_PROPERTIES):
            raise UnreadableSourceError(f"{name}: damaged: more nodes or properties than a sensor "
                                        "has")


def _text(name: Path, content: bytes) -> tuple[str, bytes]:
    """Split a counted, zero-ended string from what follows it."""
    length = _U32.unpack_from(content)[0] if len(content) >= _U32.size else 0
    end = _U32.size + length
    text = content[_U32.size:end].decode("latin-1")
    # OpenNI2 crashes on a byte outside ASCII: it indexes a hash table with it, signed.
    if (end > len(content) or length > _MAX_NAME_BYTES or text[-1:] != "\0"
            or not text.isascii() or not text[:-1].isprintable()):
        raise UnreadableSourceError(f"{name}: damaged: a record has no valid name")
    return text[:-1], content[end:]
