"""Names and paths of the files in the data folder."""

import os
import re
from collections.abc import Container
from contextlib import suppress
from dataclasses import dataclass
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
_QUARANTINED = re.compile(r"\d{4}-\d\d-\d\dT\d{6}\.\d{3}\+0000\..+")
"""The time at which it came, and its name; a report's has `.json` behind it."""
_TEMPORARY_NAME = re.compile(
    r"\.(?:[0-9a-f]{16}|[A-Za-z0-9][A-Za-z0-9_-]{0,63}\.(?:frame|[0-9a-f]{1,64}\.face)(?:\.\d+)?)\.tmp")
"""As `write_atomically`, an older release and `unnamed_face` name it."""


_OWN_FOLDERS = {
    "frames": (_FRAME_NAME, _UNNAMED_FRAME, _TEMPORARY_NAME),
    "faces": (_FACE_NAME, _TEMPORARY_NAME),
    "quarantine": (_QUARANTINED, _TEMPORARY_NAME)}
"""Names of a hub's own files, by folder."""
_DATABASE = "captures.sqlite3"
_OWN_FILES = ("lock", "ballast", _DATABASE, f"{_DATABASE}-wal", f"{_DATABASE}-shm")


def is_quarantined(path: Path) -> bool:
    """Whether a file in the folder of damaged files was put there by a hub."""
    return _QUARANTINED.fullmatch(path.name) is not None


def kept_bytes(root: Path) -> int:
    """Give the size of a hub's own files in its data folder, bytes.

    One that is removed meanwhile has none. OSError where a folder cannot be read.
    """
    own = [root / name for name in _OWN_FILES]
    for folder, patterns in _OWN_FOLDERS.items():
        names = os.listdir(root / folder)  # noqa: PTH208  a path for each takes longer
        own += [root / folder / name for name in names
                if any(pattern.fullmatch(name) for pattern in patterns)]
    total = 0
    for path in own:
        with suppress(FileNotFoundError):
            total += path.lstat().st_size
    return total


@dataclass(frozen=True)
class Listing:
    """What is in the folders of frames and faces, each listed once."""

    frames: list[str]
    """Capture ids, sorted as are all here."""
    unnamed: list[str]
    """Capture ids of frames that were not named when their hub ended."""
    faces: list[tuple[str, str]]
    """Capture id and name of the file."""
    temporary: list[Path]
    """Half-written files of a hub that was killed, those in quarantine too."""
    unknown: list[Path]
    """Not a hub's, those in the data folder itself too: never counted, never removed."""


class FolderLayout:
    """The paths of a data folder; creates the folders that are missing, durably.

    Raises SettingsError or OSError where a folder cannot be created or is another user's.
    """

    def __init__(self, root: Path) -> None:
        self.frames = private_folder(root / "frames")
        self.faces = private_folder(root / "faces")
        self.quarantine = private_folder(root / "quarantine")
        self.database = root / _DATABASE
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

    def faces_of(self, capture_ids: Container[str]) -> list[tuple[str, Path]]:
        """Give capture id and path of the faces of some captures, whatever their settings."""
        found = []
        for name in os.listdir(self.faces):  # noqa: PTH208  a path for each takes longer
            match = _FACE_NAME.fullmatch(name) or _UNNAMED_FACE.fullmatch(name)
            if match and match.group(1) in capture_ids:
                found.append((match.group(1), self.faces / name))
        return found

    def listing(self) -> Listing:
        """List the folders; OSError where one cannot be."""
        found = Listing([], [], [], [], [])
        for name in sorted(os.listdir(self.frames)):  # noqa: PTH208
            if match := _FRAME_NAME.fullmatch(name):
                found.frames.append(match.group(1))
            elif match := _UNNAMED_FRAME.fullmatch(name):
                found.unnamed.append(match.group(1))
            else:
                _note_other(found, self.frames / name)
        for name in sorted(os.listdir(self.faces)):  # noqa: PTH208
            if match := _FACE_NAME.fullmatch(name):
                found.faces.append((match.group(1), name))
            else:
                _note_other(found, self.faces / name)
        for path in sorted(self.quarantine.iterdir()):
            if not is_quarantined(path):
                _note_other(found, path)
        ours = {*_OWN_FOLDERS, *_OWN_FILES}
        found.unknown.extend(path for path in sorted(self.root.iterdir()) if path.name not in ours)
        return found


def _note_other(found: Listing, path: Path) -> None:
    (found.temporary if _TEMPORARY_NAME.fullmatch(path.name) else found.unknown).append(path)
