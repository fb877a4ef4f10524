"""Which file is where in the data folder."""

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from denseface.service.runtime.files import private_folder, sync_folder

__all__ = ["FolderLayout"]

_FRAME = re.compile(r"([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.frame")
_FACE = re.compile(r"([A-Za-z0-9][A-Za-z0-9_-]{0,63})\.[0-9a-f]{1,64}\.face")
_TEMPORARY = re.compile(r"\..*\.tmp")


class FolderLayout:
    """The paths of a data folder; makes the folders that are missing, durably.

    Raises
    ------
    SettingsError, OSError
        Where a folder cannot be made or is not this user's.
    """

    def __init__(self, root: Path) -> None:
        self.frames = private_folder(root / "frames")
        self.faces = private_folder(root / "faces")
        self.quarantine = private_folder(root / "quarantine")
        self.database = root / "captures.sqlite3"
        self.lock = root / "lock"
        self.ballast = root / "ballast"
        self.root = root
        sync_folder(root)
        with suppress(PermissionError):  # to sync it, it must be readable
            sync_folder(root.absolute().parent)

    def frame(self, capture_id: str) -> Path:
        """Where a capture's frame is."""
        return self.frames / f"{capture_id}.frame"

    def face(self, capture_id: str, settings_hash: str) -> Path:
        """Where a capture's face is."""
        return self.faces / f"{capture_id}.{settings_hash}.face"

    def database_files(self) -> list[Path]:
        """Give the database's files, there or not."""
        return [self.database.with_name(self.database.name + ending)
                for ending in ("", "-wal", "-shm")]

    def all_frames(self) -> Iterator[tuple[str, Path]]:
        """Give each frame's file with the id of its capture."""
        return _named(self.frames, _FRAME)

    def all_faces(self) -> Iterator[tuple[str, Path]]:
        """Give each face's file with the id of its capture."""
        return _named(self.faces, _FACE)

    def half_written(self) -> Iterator[Path]:
        """Give what a killed hub left behind."""
        for folder in (self.frames, self.faces, self.quarantine):
            yield from (path for path in folder.iterdir() if _TEMPORARY.fullmatch(path.name))

    def unknown(self) -> Iterator[Path]:
        """Give what is not ours."""
        ours = {self.frames, self.faces, self.quarantine, self.lock, self.ballast,
                *self.database_files()}
        yield from (path for path in self.root.iterdir() if path not in ours)
        for folder, name in ((self.frames, _FRAME), (self.faces, _FACE)):
            yield from (path for path in folder.iterdir() if not name.fullmatch(path.name))


def _named(folder: Path, name: re.Pattern[str]) -> Iterator[tuple[str, Path]]:
    for path in sorted(folder.iterdir()):
        if match := name.fullmatch(path.name):
            yield match.group(1), path
