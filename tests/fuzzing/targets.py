"""What must hold of every input, and what each cost."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from denseface.service.errors import ProtocolError
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.wire import (
    Packet,
    decode_from_hub,
    decode_stored,
    decode_to_hub,
    encode,
)
from tests.fuzzing.corpus import Parts

__all__ = ["DECODERS", "Cost", "UnexpectedError", "check"]

Decoder = Callable[[Parts], Packet]
DECODERS: tuple[Decoder, ...] = (decode_to_hub, decode_from_hub)

_AGAIN = {decode_to_hub: decode_stored, decode_from_hub: decode_from_hub}
"""How each end reads what it took before: the hub its files, others nothing else."""
_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_LONGEST_REASON = 1000


class UnexpectedError(Exception):
    """A decoder did what it must not."""


def check(decode: Decoder, parts: Parts) -> bool:
    """Decode an input; True where it is a message.

    Raises
    ------
    UnexpectedError
        Where the reason of a refusal is not one line, or what was read cannot be passed on.
    Exception
        Whatever escapes the decoder besides ProtocolError.
    """
    try:
        packet = decode(parts)
    except ProtocolError as error:
        reason = str(error)
        if not reason.isprintable() or len(reason) > _LONGEST_REASON:
            raise UnexpectedError(f"the reason is not one short line: {reason!r}") from error
        return False
    try:
        again = _AGAIN[decode](encode(packet))
    except ProtocolError as error:
        raise UnexpectedError(f"what was read cannot be passed on: {error}") from error
    if again.message != packet.message or any(
            again.arrays[name].tobytes() != array.tobytes()
            for name, array in packet.arrays.items()):
        raise UnexpectedError(f"what is passed on is not what was read: {packet.message!r}")
    try:
        payload = packet.message.payload
        if isinstance(payload, FrameHeader | FaceHeader):
            payload.join(packet.arrays)
    except ProtocolError:
        pass
    return True


@dataclass
class Cost:
    """What the inputs of a run cost."""

    inputs: int = 0
    messages: int = 0
    """Inputs that a decoder took for a message."""
    slowest_s: float = 0.0
    """Processor time of one input through both decoders."""
    slowest: bytes = b""
    grown_bytes: int = 0
    """The most that the process grew in one input."""
    peak_bytes: int = 0
    """The most that it had."""

    def run(self, parts: Parts) -> None:
        """Check one input with every decoder; raises as `check`."""
        size = _reset_peak()
        start = time.thread_time()
        found = [check(decode, parts) for decode in DECODERS]
        took = time.thread_time() - start
        self.inputs += 1
        self.messages += any(found)
        if took > self.slowest_s:
            self.slowest_s, self.slowest = took, b" ".join(parts)
        self.peak_bytes = max(self.peak_bytes, peak := _peak_bytes())
        self.grown_bytes = max(self.grown_bytes, peak - size)


def _peak_bytes() -> int:
    """Give the most memory that this process had since `_reset_peak`."""
    status = _STATUS.read_bytes()
    at = status.index(b"VmHWM:")
    return int(status[at + 6:].split(None, 1)[0]) * 1024


def _reset_peak() -> int:
    _RESET.write_bytes(b"5")
    return _peak_bytes()
