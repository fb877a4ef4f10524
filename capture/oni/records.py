r"""The layout of an `.oni` file: a header, then records, all little-endian.

Each record is ``NIR\0``, uint32 type, node, size of fields (with this head), size of payload,
uint64 position of the record that it replaces or 0, fields, payload. As in OpenNI2's
`OniDataRecords.h`.
"""

import struct
from enum import IntEnum

DEPTH_NODE, IMAGE_NODE = 2, 3
"""Kinds of node, as in a record that adds one."""

DESCRIPTION = "denseface"
"""Property in which `capture.oni.writer` says what no other record has, as JSON."""

HEADER = struct.Struct("<4sBBHIQI")
"""Of the file: ``NI10``, version (four numbers), largest stamp (us), largest number of a node."""
HEAD = struct.Struct("<4s4IQ")
"""Of a record, see above."""
MAGIC = b"NIR\0"
"""What a record starts with."""
U32 = struct.Struct("<I")
"""A count, or a size."""
MODE = struct.Struct("<III")
"""Of an image: width, height, frames a second."""
FRAME = struct.Struct("<QI")
"""Fields of a frame's record: stamp (us) and number, from 1. The image is the payload."""
DATA_BEGIN = struct.Struct("<IQ")
"""Fields of the record after which frames come: number of frames and last stamp (us)."""
NODE_TAIL = struct.Struct("<4sIQQQ")
"""End of the fields of a record that adds a node: codec, frames, first and last stamp (us), and
where the table of its frames is; 0 for none."""
SEEK_ENTRY = struct.Struct("<QIQ")
"""Of that table: stamp (us), number of the configuration, position of the frame's record."""
CROPPING = struct.Struct("<I4H")
"""Of a property: on or off, left, top, width, height."""


class Kind(IntEnum):
    """Types of record."""

    NODE_ADDED_4 = 0x02
    """As format 1.0.0.4 has it: without number of frames and stamps."""
    INT = 0x03
    """A property, as are the next three."""
    REAL = 0x04
    STRING = 0x05
    GENERAL = 0x06
    NODE_REMOVED = 0x07
    DATA_BEGIN = 0x08
    STATE_READY = 0x09
    """A node's properties are complete."""
    NEW_DATA = 0x0A
    """A frame."""
    END = 0x0B
    NODE_ADDED_5 = 0x0C
    """As format 1.0.0.5 has it: without a table of frames."""
    NODE_ADDED = 0x0D
    SEEK_TABLE = 0x0E


NODE_ADDED = (Kind.NODE_ADDED_4, Kind.NODE_ADDED_5, Kind.NODE_ADDED)
PROPERTIES = (Kind.INT, Kind.REAL, Kind.STRING, Kind.GENERAL)

MAX_IMAGE_BYTES = 1600 * 1200 * 3
"""Of an image that OpenNI2's player takes: the size of its buffer."""
MAX_STAMP_US = 10**17
"""Of a frame: three thousand years; more is damage."""
UNKNOWN_FRAMES, UNKNOWN_STAMP = 2**32 - 1, 2**64 - 1
"""Number of frames and last stamp while they are not known."""


def record(kind: Kind, node: int, fields: bytes = b"", payload: bytes = b"",
           replaces: int = 0) -> bytes:
    """Give a record."""
    return (HEAD.pack(MAGIC, kind, node, HEAD.size + len(fields), len(payload), replaces)
            + fields + payload)


def counted(text: str) -> bytes:
    """Give a text as fields have it: its size, then ASCII with a zero at the end."""
    data = text.encode("ascii") + b"\0"
    return U32.pack(len(data)) + data


def general_property(node: int, name: str, value: bytes, kind: Kind = Kind.GENERAL) -> bytes:
    """Give a record that sets a property."""
    return record(kind, node, counted(name) + U32.pack(len(value)) + value)


def int_property(node: int, name: str, value: int) -> bytes:
    """Give a record that sets a whole-number property."""
    return general_property(node, name, struct.pack("<Q", value), Kind.INT)


def real_property(node: int, name: str, value: float) -> bytes:
    """Give a record that sets a real-number property."""
    return general_property(node, name, struct.pack("<d", value), Kind.REAL)


def cropping_properties(node: int) -> bytes:
    """Give the records that say that images are not cropped.

    Where they are missing, OpenNI2's player drops every frame and says nothing.
    """
    return (int_property(node, "Cropping", 1)
            + general_property(node, "xnCropping", CROPPING.pack(0, 0, 0, 0, 0)))
