"""Names and paths of the files in the data folder."""

import re
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path

from denseface.service.runtime.files import private_folder, sync_folder

_FRAME_NAME = re.compile(r"([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.frame")
"""Capture id."""
_UNNAMED_FRAME = re.compile(r"([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.pending")
"""Capture id."""
_FACE_NAME = re.compile(r"([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.[0-9a-f]{1,64}\.face")
"""Capture id and settings hash."""
_UNNAMED_FACE = re.compile(r"\.([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.[0-9a-f]{1,64}\.face\.tmp")
"""Capture id and settings hash."""
_TEMPORARY_NAME = re.compile(r"\..*\.tmp")
"""As `write_atomically` and `unnamed_face` name it."""


class FolderLayout:
    """The paths of a data folder; creates the folders that are missing, durably.

    Raises SettingsError or OSError where a folder cannot be created or is another user's.
    """

    def __init__(self, root: Path) -> None:
        self.frames = private_folder(root / "frames")
        self.faces = private_folder(root / "faces")
        self.quarantine = private_folder(root / "quarantine")
        self.database = root / "captures.sqlite3"
        self.lock = root / "lock"
        self.disk_reserve = root / "ballast"
        self.root = root
        sync_folder(root)
        with suppress(PermissionError):  # a folder that cannot be read cannot be synced
            sync_folder(root.absolute().parent)

    def frame(self, capture_id: str) -> Path:
        """Give the path of a capture's frame."""
        return self.frames / f"{capture_id}.frame"

    def unnamed_frame(self, capture_id: str) -> Path:
        """Give the path of a capture's frame until its row is written."""
        return self.frames / f"{capture_id}.pending"

    def accepted_frame(self, capture_id: str) -> Path:
        """Give the path of the frame of a capture that has a row: it may be named later."""
        path = self.frame(capture_id)
        return path if path.exists() else self.unnamed_frame(capture_id)

    def face(self, capture_id: str, settings_hash: str) -> Path:
        """Give the path of a capture's face."""
        return self.faces / f"{capture_id}.{settings_hash}.face"

    def unnamed_face(self, capture_id: str, settings_hash: str) -> Path:
        """Give the path of a capture's face while it is written."""
        return self.faces / f".{capture_id}.{settings_hash}.face.tmp"

    def database_files(self) -> list[Path]:
        """Give the paths of SQLite's files, which need not exist."""
        return [self.database.with_name(self.database.name + ending)
                for ending in ("", "-wal", "-shm")]

    def all_frames(self) -> Iterator[tuple[str, Path]]:
        """Give capture id and path of each frame."""
        return _matching(self.frames, _FRAME_NAME)

    def unnamed_frames(self) -> Iterator[tuple[str, Path]]:
        """Give capture id and path of each frame that was not named when its hub ended."""
        return _matching(self.frames, _UNNAMED_FRAME)

    def all_faces(self) -> Iterator[tuple[str, Path]]:
        """Give capture id and path of each face."""
        return _matching(self.faces, _FACE_NAME)

    def faces_of(self, capture_ids: Container[str]) -> list[tuple[str, Path]]:
        """Give capture id and path of the faces of some captures, whatever their settings."""
        return [(capture_id, path) for name in (_FACE_NAME, _UNNAMED_FACE)
                for capture_id, path in _matching(self.faces, name) if capture_id in capture_ids]

    def temporary_files(self) -> Iterator[Path]:
        """Give half-written files of a hub that was killed."""
        for folder in (self.frames, self.faces, self.quarantine):
            yield from (path for path in folder.iterdir() if _TEMPORARY_NAME.fullmatch(path.name))

    def unknown_files(self) -> Iterator[Path]:
        """Give files that the hub did not write."""
        ours = {self.frames, self.faces, self.quarantine, self.lock, self.disk_reserve,
                *self.database_files()}
        yield from (path for path in self.root.iterdir() if path not in ours)
        for folder, names in (
                (self.frames, (_FRAME_NAME, _UNNAMED_FRAME)), (self.faces, (_FACE_NAME,))):
            yield from (path for path in folder.iterdir()
                        if not any(name.fullmatch(path.name) for name in names))


def _matching(folder: Path, name: re.Pattern[str]) -> Iterator[tuple[str, Path]]:
    for path in sorted(folder.iterdir()):
        if match := name.fullmatch(path.name):
            yield match.group(1), path
