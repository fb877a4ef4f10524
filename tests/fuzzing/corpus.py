"""One valid message of every kind, and how a message is one string of bytes for a fuzzer."""

import struct
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from denseface.recon.settings import Settings
from denseface.service.protocol import messages
from denseface.service.protocol.payload import Arrays, FaceHeader, FrameHeader, Payload
from denseface.service.protocol.wire import Packet, encode
from tests.unit.service.faces import small_face, small_frame

__all__ = ["Parts", "encoded", "pack", "packets", "unpack"]

Parts = list[bytes]

_DIGEST = "0f" * 32
_BY_TYPE: dict[str, Any] = {
    "integer": 1, "number": 0.5, "boolean": False, "array": (), "object": {}, "null": None}


def packets() -> Iterator[Packet]:
    """Give messages of every kind there is, made from the fields that the kind declares."""
    frame, _ = FrameHeader.of(small_frame())
    face, _ = FaceHeader.of(small_face())
    for kind in (*messages.TO_HUB, *messages.FROM_HUB):
        given: dict[str, Any] = {"frame": frame, "face": face, "settings": Settings()}
        schema = kind.model_json_schema()
        for name, about in schema["properties"].items():
            if name in schema.get("required", ()) and name not in given:
                given[name] = _example(about, schema.get("$defs", {}))
        given = {name: value for name, value in given.items() if name in kind.model_fields}
        # Where one of several fields must be given, the first that makes the message valid.
        for more in ({}, {"last": 3}, {"capture_id": "a0"}):
            try:
                message = kind.model_validate(given | more)
            except ValueError:
                continue
            yield Packet(message, _arrays(message.payload))
            break
        else:
            raise TypeError(f"no example of {kind.__name__} can be made from its fields")


def _arrays(payload: Payload | None) -> Arrays:
    """Give arrays of ones: positive, finite, on the grid."""
    return {info.name: np.ones(info.shape, info.dtype) for info in payload.layout()
            } if payload else {}


def _example(about: dict[str, Any], definitions: dict[str, Any]) -> Any:
    if "$ref" in about:
        return _example(definitions[about["$ref"].rpartition("/")[2]], definitions)
    if "anyOf" in about:
        return _example(about["anyOf"][0], definitions)
    if "enum" in about or "const" in about:
        return about.get("const", about.get("enum", [None])[0])
    if "properties" in about:
        return {name: _example(about["properties"][name], definitions)
                for name in about.get("required", ())}
    if about.get("type") == "string":
        return _DIGEST if "{64}" in about.get("pattern", "") else "a0"
    return _BY_TYPE[about["type"]]


def encoded() -> list[Parts]:
    """Give `packets` as they travel."""
    return [[bytes(part) for part in encode(packet)] for packet in packets()]


def pack(parts: Sequence[bytes]) -> bytes:
    """Write parts as one string of bytes."""
    sizes = struct.pack(f"<B{len(parts)}I", len(parts), *map(len, parts))
    return b"".join((sizes, *parts))


def unpack(data: bytes) -> Parts:
    """Read what `pack` wrote; anything else is one part."""
    count = data[0] if data else 0
    start = 1 + 4 * count
    if not count or len(data) < start:
        return [data]
    parts = []
    for size in struct.unpack_from(f"<{count}I", data, 1):
        parts.append(data[start:start + size])
        start += size
    return parts
