"""What a frame's and a face's file hold: all that the database knows of them, and more.

The first part says when and with which settings; then comes the message as it arrived. So the
database can be made again from the files alone.
"""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from denseface.service.errors import CorruptFileError, ProtocolError
from denseface.service.protocol.messages import Frame, Result
from denseface.service.protocol.payload import Arrays
from denseface.service.protocol.wire import Packet, decode_kept, encode
from denseface.service.storage.record_file import read_parts, write_parts

__all__ = [
    "FaceMetadata",
    "FaceRecord",
    "FrameMetadata",
    "FrameRecord",
    "PendingWrite",
    "read_face",
    "read_frame",
]

_Time = Annotated[str, Field(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}\+00:00$")]


class _Metadata(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    accepted_at: _Time
    clock: str
    """The store's account of its age when this was written."""


class FrameMetadata(_Metadata):
    """What a frame does not say of itself."""

    settings: str
    """Of the reconstruction, JSON."""
    settings_hash: Annotated[str, Field(pattern=r"^[0-9a-f]{1,64}$")]
    pressed_by: Annotated[str, Field(pattern=r"^[0-9a-f]{0,16}$")] = ""
    """Fingerprint of the key that pressed; empty where none was needed."""


class FaceMetadata(_Metadata):
    """What a face does not say of itself."""

    finished_at: _Time


@dataclass(frozen=True)
class FrameRecord:
    """A frame's file."""

    message: Frame
    arrays: Arrays
    metadata: FrameMetadata
    checksum: str


@dataclass(frozen=True)
class FaceRecord:
    """A face's file."""

    message: Result
    arrays: Arrays
    metadata: FaceMetadata
    checksum: str


@dataclass(frozen=True)
class PendingWrite:
    """A frame or a face before it is on the disk: its file comes first, then its row."""

    capture_id: str
    path: Path
    metadata: FrameMetadata | FaceMetadata
    packet: Packet

    @property
    def steps(self) -> str:
        """How the names of its failpoints begin."""
        return "hub.frame" if isinstance(self.metadata, FrameMetadata) else "hub.face"

    def write(self) -> str:
        """Write the file, whose name is not yet durable, and give its checksum.

        Raises as `write_parts`.
        """
        return write_parts(
            self.path, [self.metadata.model_dump_json().encode(), *encode(self.packet)],
            named=False, direct=True, steps=self.steps)

    def discard(self) -> None:
        """Remove the file; where it resists, it is taken in at the next start."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


def read_frame(path: Path, checksum: str | None = None) -> FrameRecord:
    """Read a frame.

    Raises
    ------
    CorruptFileError, StoreError
        As `read_parts`; the first also where the contents are whole and no frame.
    """
    packet, metadata, found = _read(path, checksum, FrameMetadata)
    if not isinstance(packet.message, Frame):
        raise CorruptFileError(f"{path}: holds a {packet.message.kind}, a frame expected")
    return FrameRecord(packet.message, packet.arrays, metadata, found)


def read_face(path: Path, checksum: str | None = None) -> FaceRecord:
    """Read a face; errors as `read_frame`."""
    packet, metadata, found = _read(path, checksum, FaceMetadata)
    if not isinstance(packet.message, Result):
        raise CorruptFileError(f"{path}: holds a {packet.message.kind}, a result expected")
    return FaceRecord(packet.message, packet.arrays, metadata, found)


_A = TypeVar("_A", bound=_Metadata)


def _read(path: Path, checksum: str | None, kind: type[_A]) -> tuple[Packet, _A, str]:
    parts, found = read_parts(path, checksum)
    try:
        metadata = kind.model_validate_json(bytes(parts[0]) if parts else b"")
        return decode_kept(parts[1:]), metadata, found
    except (ProtocolError, ValidationError) as error:
        # Whole, so written by another version.
        raise CorruptFileError(f"{path}: {error}") from error
