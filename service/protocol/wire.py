"""How a message is written on the wire.

A message is a list of buffers: a JSON header (one of `service.protocol.messages`), then the raw
arrays that the header describes. `encode` and `decode_*` are pure functions; `docs/wire.md`
describes the format.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from denseface.service.errors import LocalProtocolError, RemoteProtocolError, first_error
from denseface.service.protocol.message_base import BaseMessage, FromHub, ToHub
from denseface.service.protocol.messages import FROM_HUB, TO_HUB
from denseface.service.protocol.payload import Arrays
from denseface.service.runtime.terminal import printable

MAX_HEADER_BYTES = 256 * 1024
"""Longest header, from the hub or stored, bytes."""
MAX_HEADER_BYTES_TO_HUB = 64 * 1024
"""Longest header to the hub, bytes. A quarter, as the hub may write a number longer: `1e15` with 18
bytes."""
MAX_PARTS = 1 + 16
"""Header and arrays of one message."""

Buffer = bytes | memoryview
"""One part of a message."""

_MessageT = TypeVar("_MessageT", ToHub, FromHub)


def _reader(kinds: Iterable[type[_MessageT]]) -> TypeAdapter[_MessageT]:
    union: Any = Annotated[Union[tuple(kinds)], Field(discriminator="kind")]  # noqa: UP007
    return TypeAdapter(union)


_TO_HUB = _reader(TO_HUB)
_FROM_HUB = _reader(FROM_HUB)


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
        field, complaint = first_error(error)
        reason = "version" if field.rpartition(".")[2] == "version" else "malformed"
        raise RemoteProtocolError(
            printable(f"{field or 'header'}: {complaint}"[:500]), reason) from error
    if "version" not in message.model_fields_set:
        raise RemoteProtocolError(f"{message.kind}: no version given", "version")
    return message
