"""What can be looked at: faces, frames of recordings, captures of a hub."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from denseface.capture import RgbdFrame
from denseface.capture.errors import CaptureError
from denseface.recon import Face, ReconstructionError, Settings, reconstruct
from denseface.service.errors import FrameTooLargeError, UsageError
from denseface.service.export.reading import Mesh
from denseface.service.tools.frames import (
    FrameChoice,
    FrameReader,
    UnreadFrame,
    each_frame,
    read_frame,
)
from denseface.service.tools.reconstruction.inputs import Input
from denseface.service.view.messages import ItemHead

__all__ = ["FaceItem", "FrameItem", "Item", "MeshItem", "RecordingItem", "Taken"]


class Taken(NamedTuple):
    """What there is of one frame of an item: a face, a mesh, or the reason why there is none."""

    number: int
    face: Face | None = None
    frame: RgbdFrame | None = None
    error: Exception | None = None
    mesh: Mesh | None = None
    info: Mapping[str, Any] = MappingProxyType({})
    """Of a mesh: what `denseface info` says of its file."""


class Item(Protocol):
    """One thing that can be looked at."""

    @property
    def head(self) -> ItemHead:
        """Say what it is."""

    def take(self, number: int) -> Taken:
        """Give one frame of it, from 0; `UsageError` where there is none of that number."""

    def each(self) -> Iterator[Taken]:
        """Give every frame of it."""


@dataclass(frozen=True)
class FaceItem:
    """A face that is there: of a file, or of a hub.

    Parameters
    ----------
    name : as it was named
    face : the face
    frame : what it was made of, where that is known
    capture : whether a hub has it
    """

    name: str
    face: Face
    frame: RgbdFrame | None = None
    capture: bool = False

    @property
    def head(self) -> ItemHead:
        """Say what it is."""
        return ItemHead(name=self.name, kind="capture" if self.capture else "face", frames=1)

    def take(self, number: int) -> Taken:
        """Give its frame of a number."""
        _check_number(self.name, number, 1)
        return Taken(0, self.face, self.frame)

    def each(self) -> Iterator[Taken]:
        """Give every frame."""
        yield self.take(0)


@dataclass(frozen=True)
class MeshItem:
    """A mesh or a cloud of a file, of this program or another."""

    name: str
    mesh: Mesh
    info: Mapping[str, Any] = field(default_factory=dict)
    """What `denseface info` says of the file; empty where that is not known."""

    @property
    def head(self) -> ItemHead:
        """Say what it is."""
        return ItemHead(name=self.name, kind="mesh", frames=1)

    def take(self, number: int) -> Taken:
        """Give its frame of a number."""
        _check_number(self.name, number, 1)
        return Taken(0, mesh=self.mesh, info=self.info)

    def each(self) -> Iterator[Taken]:
        """Give every frame."""
        yield self.take(0)


@dataclass(frozen=True)
class FrameItem:
    """A frame that is there already, such as that of a pair of images."""

    name: str
    frame: RgbdFrame
    settings: Settings

    @property
    def head(self) -> ItemHead:
        """Say what it is."""
        return ItemHead(name=self.name, kind="frames", frames=1)

    def take(self, number: int) -> Taken:
        """Give its frame of a number."""
        _check_number(self.name, number, 1)
        return _made(0, self.frame, self.settings)

    def each(self) -> Iterator[Taken]:
        """Give every frame."""
        yield self.take(0)


@dataclass(frozen=True)
class RecordingItem:
    """Frames of a file or folder, each of which is read and reconstructed when it is asked for.

    Parameters
    ----------
    one : file or folder
    choice : how its frames are read
    settings : of the reconstruction
    first : the frame that is shown first; it was read once, so that what is wrong is said early
    frames : how many there are; None where that is not known
    """

    one: Input
    choice: FrameChoice
    settings: Settings
    first: int
    frames: int | None
    _reader: FrameReader = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_reader", FrameReader(self.one.uri, self.choice))

    @classmethod
    def opened(
        cls, one: Input, choice: FrameChoice, settings: Settings, first: int
    ) -> "RecordingItem":
        """Open it; errors as `read_frame`."""
        if one.problem:
            raise UsageError(f"{one.uri}: {one.problem}")
        return cls(one, choice, settings, first, read_frame(one.uri, first, choice).total)

    @property
    def head(self) -> ItemHead:
        """Say what it is."""
        return ItemHead(name=self.one.uri, kind="frames", first=self.first, frames=self.frames)

    def take(self, number: int) -> Taken:
        """Give its frame of a number."""
        try:
            frame = self._reader.read(number)
        except (CaptureError, FrameTooLargeError) as error:
            return Taken(number, error=error)
        return _made(number, frame, self.settings)

    def each(self) -> Iterator[Taken]:
        """Give every frame."""
        for read in each_frame(self.one.uri, self.choice):
            if isinstance(read, UnreadFrame):
                yield Taken(read.number or 0, error=CaptureError(read.problem))
            else:
                yield _made(read.number, read.frame, self.settings)


def _made(number: int, frame: RgbdFrame, settings: Settings) -> Taken:
    try:
        return Taken(number, reconstruct(frame, settings), frame)
    except ReconstructionError as error:
        return Taken(number, None, frame, error)


def _check_number(name: str, number: int, frames: int) -> None:
    if number >= frames:
        raise UsageError(f"{name}: has {frames} frame{'s' * (frames > 1)}, frame {number} is asked "
                         "for")
