"""The files of frames and faces, from which alone the database can be rebuilt.

Part 0 of the file is the metadata, JSON; the other parts are the message as it arrived.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Generic, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from denseface.recon.face import Consent
from denseface.service.errors import CorruptFileError, ProtocolError
from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.messages import Frame, Result
from denseface.service.protocol.payload import Arrays
from denseface.service.protocol.wire import Packet, decode_stored, decode_stored_header, encode
from denseface.service.runtime.failpoints import failpoint
from denseface.service.storage._record_file import (
    read_head,
    read_parts,
    wrap_os_errors,
    write_parts,
)

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
"""As `format_timestamp` writes it: ISO 8601, milliseconds, UTC."""


class _Metadata(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    accepted_at: _Time
    clock: str
    """What `StoreClock.save` gave when this was written."""
    pressed_by: Annotated[str, Field(pattern=r"^[0-9a-f]{0,16}$")] = ""
    """Fingerprint of the key that pressed; empty where none was needed."""
    consent: Consent | None = None
    """That came with the press."""
    due_age_s: FiniteFloat | None = None
    """Age of the store at which the capture goes, as the consent promises, seconds."""


class FrameMetadata(_Metadata):
    """What the database knows of a frame and its message does not say."""

    settings: str
    """Settings of the reconstruction, JSON."""
    settings_hash: Annotated[str, Field(pattern=r"^[0-9a-f]{1,64}$")]


class FaceMetadata(_Metadata):
    """What the database knows of a face and its message does not say."""

    finished_at: _Time


MessageT = TypeVar("MessageT", Frame, Result)
MetadataT = TypeVar("MetadataT", FrameMetadata, FaceMetadata)


@dataclass(frozen=True)
class Head(Generic[MessageT, MetadataT]):
    """What the file of a frame or a face says before its arrays; only with them is it checked."""

    message: MessageT
    metadata: MetadataT
    checksum: str


@dataclass(frozen=True)
class Record(Generic[MessageT, MetadataT]):
    """The file of a frame or a face."""

    message: MessageT
    arrays: Arrays
    metadata: MetadataT
    checksum: str


FrameRecord: TypeAlias = Record[Frame, FrameMetadata]
FaceRecord: TypeAlias = Record[Result, FaceMetadata]
FrameHead: TypeAlias = Head[Frame, FrameMetadata]
FaceHead: TypeAlias = Head[Result, FaceMetadata]


@dataclass(frozen=True)
class PendingWrite:
    """A frame or a face of which neither file nor row is written.

    It is written under a name that says so. A face gets its own name once it is safe. A frame does
    when its row is written: without one it was not accepted, and the next hub removes it.
    """

    capture_id: str
    path: Path
    """Its file at last."""
    unnamed: Path
    """Its file until then."""
    metadata: FrameMetadata | FaceMetadata
    packet: Packet

    @property
    def is_frame(self) -> bool:
        """Whether this is a frame; else it is a face."""
        return isinstance(self.metadata, FrameMetadata)

    @property
    def failpoints(self) -> str:
        """Prefix of the names of its failpoints."""
        return "hub.frame" if self.is_frame else "hub.face"

    def write(self) -> str:
        """Write and sync the file, not its folder; give its checksum; raises as `write_parts`."""
        return write_parts(
            self.unnamed,
            [self.metadata.model_dump_json(exclude_none=True).encode(), *encode(self.packet)],
            failpoints=self.failpoints)

    def name(self) -> None:
        """Give the file its name; raises as `wrap_os_errors`."""
        with wrap_os_errors(self.path):
            self.unnamed.replace(self.path)
            failpoint(f"{self.failpoints}.renamed")


def read_frame(path: Path, checksum: str | None = None) -> FrameRecord:
    """Read a frame.

    Raises
    ------
    CorruptFileError, StoreError
        As `read_parts`; CorruptFileError also where the file holds something else.
    """
    return _read(path, checksum, Frame, FrameMetadata)


def read_face(path: Path, checksum: str | None = None) -> FaceRecord:
    """Read a face; errors as `read_frame`."""
    return _read(path, checksum, Result, FaceMetadata)


def read_frame_head(path: Path) -> FrameHead:
    """Read a frame's file up to its arrays.

    Raises
    ------
    CorruptFileError, StoreError
        As `read_head`; CorruptFileError also where the file holds something else.
    """
    return _read_head(path, Frame, FrameMetadata)


def read_face_head(path: Path) -> FaceHead:
    """Read a face's file up to its arrays; errors as `read_frame_head`."""
    return _read_head(path, Result, FaceMetadata)


def _read(
    path: Path, checksum: str | None, kind: type[MessageT], metadata_kind: type[MetadataT]
) -> Record[MessageT, MetadataT]:
    parts, found = read_parts(path, checksum)
    # Where that raises, the checksum is right: another version wrote it.
    with _understood(path):
        metadata = metadata_kind.model_validate_json(bytes(parts[0]) if parts else b"")
        packet = decode_stored(parts[1:])
    return Record(_expected(path, packet.message, kind), packet.arrays, metadata, found)


def _read_head(
    path: Path, kind: type[MessageT], metadata_kind: type[MetadataT]
) -> Head[MessageT, MetadataT]:
    head = read_head(path, 2)
    with _understood(path):
        metadata = metadata_kind.model_validate_json(bytes(head.parts[0]))
        message = decode_stored_header(head.parts[1], head.sizes[2:])
    return Head(_expected(path, message, kind), metadata, head.checksum)


@contextmanager
def _understood(path: Path) -> Iterator[None]:
    try:
        yield
    except (ProtocolError, ValidationError) as error:
        raise CorruptFileError(f"{path}: {error}") from error


def _expected(path: Path, message: BaseMessage, kind: type[MessageT]) -> MessageT:
    if not isinstance(message, kind):
        expected = kind.__name__.lower()
        raise CorruptFileError(f"{path}: holds a {message.kind}, a {expected} expected")
    return message
