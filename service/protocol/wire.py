"""How a message is written on the wire.

A message is a list of buffers: a JSON header (one of `service.protocol.messages`), then the raw
arrays that the header describes. `encode` and `decode_*` are pure functions; `docs/wire.md`
describes the format.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import from_json

from denseface.service.errors import LocalProtocolError, RemoteProtocolError
from denseface.service.protocol.message_base import VERSION, BaseMessage, FromHub, ToHub
from denseface.service.protocol.messages import FROM_HUB, TO_HUB
from denseface.service.protocol.payload import Arrays
from denseface.service.runtime.terminal import printable
from denseface.validation import complaint

MAX_HEADER_BYTES = 256 * 1024
"""Longest header, from the hub or stored, bytes."""
MAX_HEADER_BYTES_TO_HUB = 64 * 1024
"""Longest header to the hub, bytes. A quarter, as the hub may write a number longer: `1e15` with 18
bytes."""
MAX_PARTS = 1 + 16
"""Header and arrays of one message."""
_MOST_SHOWN = 60
"""Characters of a value that a refusal shows."""

Buffer = bytes | memoryview
"""One part of a message."""

_MessageT = TypeVar("_MessageT", ToHub, FromHub)


def _reader(kinds: Iterable[type[_MessageT]]) -> TypeAdapter[_MessageT]:
    union: Any = Annotated[Union[tuple(kinds)], Field(discriminator="kind")]  # noqa: UP007
    return TypeAdapter(union)


_TO_HUB = _reader(TO_HUB)
_FROM_HUB = _reader(FROM_HUB)
_KINDS_TO_HUB = {kind.model_fields["kind"].default for kind in TO_HUB}
_KINDS_FROM_HUB = {kind.model_fields["kind"].default for kind in FROM_HUB}


@dataclass(frozen=True)
class Packet:
    """A message and the arrays that its header describes."""

    message: BaseMessage
    arrays: Arrays = field(default_factory=dict)


def encode(packet: Packet) -> list[Buffer]:
    """Write a message: bytes for the header, views of the arrays' memory behind it.

    LocalProtocolError where the arrays are not those that the header describes, or it is too long.
    """
    message, arrays = packet.message, packet.arrays
    header = message.model_dump_json(exclude=_left_out(message)).encode()
    if len(header) > MAX_HEADER_BYTES:
        raise LocalProtocolError(
            f"{message.kind}: header has {len(header)} bytes, at most {MAX_HEADER_BYTES} allowed")
    infos = payload.arrays if (payload := message.payload) else ()
    if set(arrays) != {info.name for info in infos}:
        raise LocalProtocolError(
            f"{message.kind}: arrays {sorted(arrays)} given, "
            f"{sorted(info.name for info in infos)} expected")
    for info in infos:
        array = arrays[info.name]
        if array.dtype != np.dtype(info.dtype) or array.shape != info.shape:
            raise LocalProtocolError(
                f"{message.kind}: {info.name} is {array.dtype} {list(array.shape)}, "
                f"the header says {info.dtype} {list(info.shape)}")
    return [header, *(_raw(arrays[info.name].astype(info.dtype, copy=False)) for info in infos)]


def _left_out(message: BaseMessage) -> set[str]:
    """Give the fields that the first release of this version did not have and need not have."""
    fields = type(message).model_fields
    return {name for name in message.newer if getattr(message, name) == fields[name].default}


def _raw(array: NDArray[Any]) -> memoryview:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def decode_to_hub(parts: Sequence[Buffer]) -> Packet:
    """Read a message that the hub may receive: its header, then one buffer for each array.

    Arrays of the result are read-only views. RemoteProtocolError where a limit is exceeded, or a
    field, dtype, shape or size is wrong.
    """
    return _decode(parts, _TO_HUB, MAX_HEADER_BYTES_TO_HUB)


def decode_stored(parts: Sequence[Buffer]) -> Packet:
    """Read a message to the hub that was stored; otherwise as `decode_to_hub`."""
    return _decode(parts, _TO_HUB, MAX_HEADER_BYTES)


def decode_stored_header(header: Buffer, sizes: Sequence[int]) -> BaseMessage:
    """Read the header alone of a message that was stored; otherwise as `decode_to_hub`.

    Parameters
    ----------
    sizes : of the arrays that follow it, bytes
    """
    return _message(header, sizes, _TO_HUB, MAX_HEADER_BYTES)


def decode_from_hub(parts: Sequence[Buffer]) -> Packet:
    """Read a message that only the hub may send; otherwise as `decode_to_hub`."""
    return _decode(parts, _FROM_HUB, MAX_HEADER_BYTES)


def _decode(parts: Sequence[Buffer], reader: TypeAdapter[_MessageT], most: int) -> Packet:
    if not parts:
        raise RemoteProtocolError(f"message has 0 parts, 1 to {MAX_PARTS} expected", "truncated")
    header, *buffers = parts
    message = _message(header, [len(one) for one in buffers], reader, most)
    infos = payload.arrays if (payload := message.payload) else ()
    return Packet(message, {
        info.name: np.frombuffer(memoryview(buffer).toreadonly(), info.dtype).reshape(info.shape)
        for info, buffer in zip(infos, buffers, strict=True)})


def _message(
    header: Buffer, sizes: Sequence[int], reader: TypeAdapter[_MessageT], most: int
) -> _MessageT:
    """Read a header that says which arrays of these sizes, bytes, follow it."""
    if len(sizes) >= MAX_PARTS:
        raise RemoteProtocolError(
            f"message has {1 + len(sizes)} parts, 1 to {MAX_PARTS} expected", "oversized")
    if len(header) > most:
        raise RemoteProtocolError(
            f"header has {len(header)} bytes, at most {most} allowed", "oversized")
    if not len(header) and sizes:
        raise RemoteProtocolError(
            "header: empty, as a REQ socket begins: expected a DEALER's, with the header first")
    message = _header(bytes(header), reader)
    infos = payload.arrays if (payload := message.payload) else ()
    if len(sizes) != len(infos):
        raise RemoteProtocolError(
            f"{message.kind}: {len(sizes)} arrays follow, {len(infos)} announced", "truncated")
    for info, size in zip(infos, sizes, strict=True):
        if size != info.nbytes:
            raise RemoteProtocolError(
                f"{message.kind}: {info.name} has {size} bytes, {info.nbytes} announced",
                "truncated")
    return message


def _header(header: bytes, reader: TypeAdapter[_MessageT]) -> _MessageT:
    try:
        with np.errstate(all="ignore"):  # absurd calibrations overflow before they are refused
            message = reader.validate_json(header)
    except ValidationError as error:
        version = readable(header).get("version", VERSION)
        if version != VERSION:  # first: of another release's message nothing else need be right
            raise RemoteProtocolError(
                printable(f"version: found {_shown(version)}, expected {VERSION}"), "version"
                ) from error
        raise RemoteProtocolError(printable(_complaint(error)[:500])) from error
    if "version" not in message.model_fields_set:
        raise RemoteProtocolError(
            f"{message.kind}: no version given, expected {VERSION}", "version")
    return message


def _complaint(error: ValidationError) -> str:
    """Say which field of a header is wrong first, and what was found in it."""
    first = error.errors(include_url=False)[0]
    field, found = ".".join(map(str, first["loc"])), f", found {_shown(first['input'])}"
    match first["type"]:
        case "union_tag_not_found":
            return "kind: missing"
        case "union_tag_invalid":
            kind = first["ctx"]["tag"]
            why = ("only the hub says that" if kind in _KINDS_FROM_HUB else
                   "not one that is said to the hub" if kind in _KINDS_TO_HUB else
                   "no such kind of message")
            return f"kind: found {_shown(kind)}, {why}"
        case "json_invalid":
            return f"header: {first['msg']}"
        case _ if not field:
            return f"header: expected a JSON object{found}"
        case "extra_forbidden":
            return f"{field}: no such field{found}"
        case "missing" | "value_error" | "assertion_error":
            return f"{field}: {complaint(first)}"
    return f"{field}: {complaint(first)}{found}"


def _shown(value: object) -> str:
    if value is None or isinstance(value, bool):
        return str(value).lower().replace("none", "null")
    if isinstance(value, str | int | float):
        return repr(value[:_MOST_SHOWN] if isinstance(value, str) else value)[:_MOST_SHOWN + 2]
    return "an object" if isinstance(value, dict) else "an array"


def readable(header: Buffer) -> dict[str, Any]:
    """Give what can be read of a header that is malformed or cut off; empty where that is nothing.

    Its values are believed by nobody.
    """
    text = bytes(header[:MAX_HEADER_BYTES_TO_HUB]).decode(errors="replace")
    for cut in (False, True):
        with suppress(ValueError):
            found = from_json(text, allow_partial=cut)
            if not isinstance(found, dict):
                break
            if cut and found:
                found.popitem()  # its end may be missing
            return found
    return {}
