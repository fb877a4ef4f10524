"""What the words of the command line stand for: files, recordings, captures of a hub."""

import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from denseface.capture.errors import CaptureError
from denseface.capture.source import ReplayOptions
from denseface.recon import Settings
from denseface.service.errors import FormatError, UsageError
from denseface.service.export import load_face
from denseface.service.export.reading import MESH_ENDINGS, read_mesh
from denseface.service.tools.frames import FrameChoice
from denseface.service.tools.info import Info, inspect
from denseface.service.tools.reconstruction.inputs import find_inputs
from denseface.service.tools.reconstruction.single import take_pair
from denseface.service.view.items import FaceItem, FrameItem, Item, MeshItem, RecordingItem
from denseface.validation import CAPTURE_ID

__all__ = ["Reader"]

_WHOLE = ".npz"
_MESHES = frozenset(MESH_ENDINGS) - {_WHOLE}
_PART_OF_FACES = "dense_points.npy"
"""In an archive; frames have no such array."""


@dataclass(frozen=True)
class Reader:
    """Reads what can be looked at.

    Parameters
    ----------
    choice : how frames are read
    settings : of reconstructions
    first : number of the frame of a recording that is shown first
    fetch : gives a capture of a hub by its id
    """

    choice: FrameChoice
    settings: Settings
    first: int
    fetch: Callable[[str], FaceItem]

    def items(self, given: Sequence[str]) -> list[Item]:
        """Read all, in the order given.

        A word that names no file and is as a capture's id is one.

        Raises
        ------
        UsageError
            There is no such file, and it can be no capture; or a folder holds nothing to look at.
        CaptureError, FormatError, FrameTooLargeError
            A file cannot be read.
        """
        return [item for one in given for item in self._items(one)]

    def pair(self, depth: Path, color: Path | None) -> Item:
        """Read the frame of two image files; errors as `read_image_pair`."""
        taken = take_pair(depth, color, self.choice)
        return FrameItem(taken.shown, taken.read.frame, self.settings)

    def _items(self, given: str) -> list[Item]:
        path = Path(ReplayOptions.split(given)[0])
        if not path.exists() and re.fullmatch(CAPTURE_ID, given):
            return [self.fetch(given)]
        if path.suffix.lower() == _WHOLE and _is_face(path):
            return [FaceItem(given, load_face(path))]
        if path.suffix.lower() in _MESHES:
            return [MeshItem(given, read_mesh(path), _info(path))]
        inputs = find_inputs([given])
        if not inputs:
            raise UsageError(f"{given}: a calibration, expected a face, frame, recording or folder")
        return [RecordingItem.opened(one, self.choice, self.settings, self.first)
                for one in inputs]


def _info(path: Path) -> Info:
    """Say what a file of a mesh tells of itself; nothing where it tells it wrongly."""
    try:
        return inspect(path)
    except (FormatError, CaptureError):
        return {}


def _is_face(path: Path) -> bool:
    """Say whether an archive holds a face; false where it cannot be read: that is said later."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _PART_OF_FACES in archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError):
        return False
