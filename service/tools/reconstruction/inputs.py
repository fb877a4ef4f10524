"""What there is to reconstruct in files and folders, and what each is called."""

import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from denseface.capture.errors import CaptureError
from denseface.capture.image_pair import FolderSource
from denseface.capture.source import ReplayOptions
from denseface.service.errors import UsageError, reason_of

__all__ = ["FRAME", "RECORDING", "SIDE", "Input", "find_inputs", "is_of_pairs", "refuse_sensor"]

RECORDING, FRAME, SIDE = ".oni", ".npz", ".calibration.json"
"""Endings of recordings, of frame files, and of calibrations beside either."""


class Input(NamedTuple):
    """A file or folder that is one source."""

    uri: str
    name: str
    """What its faces are called; no two inputs have the same."""
    problem: str = ""
    """Why it cannot be read; empty where that is not known before it is opened."""

    @property
    def path(self) -> Path:
        """The file or folder, without options."""
        return Path(ReplayOptions.split(self.uri)[0])


def find_inputs(given: Sequence[str]) -> list[Input]:
    """Find the sources in files and folders, each once, in the order given.

    A folder with recordings stands for each of them, and for each frame file beside them; one with
    frame files alone, or with image pairs in a layout that is known, is one source, as a recording
    is; any other stands for its subfolders. Calibrations beside recordings are passed over.

    A source is called as its file or folder is, without the ending. Where two would be called the
    same, the name of the folder that each is in goes before it (`first_take`, `second_take`), and
    then a number after it (`take-2`).

    Raises
    ------
    UsageError
        A live sensor is named.
    """
    found: dict[Path, tuple[str, str]] = {}
    for one in given:
        refuse_sensor(one)
        if one.lower().endswith(SIDE) and len(given) > 1:
            continue
        for uri, problem in _sources(one):
            path = Path(uri)
            found.setdefault(path.resolve() if path.is_dir() else path.absolute(), (uri, problem))
    names = _names([uri for uri, _ in found.values()])
    return [Input(uri, name, problem)
            for (uri, problem), name in zip(found.values(), names, strict=True)]


def refuse_sensor(given: str) -> None:
    """Raise UsageError where a live sensor is named."""
    if given.lower().startswith("openni2:"):
        raise UsageError(f"{given}: expected a .npz or .oni file or a folder; `denseface up` "
                         "serves a sensor")


def _sources(given: str) -> list[tuple[str, str]]:
    """Give the sources that an argument stands for, each with what is wrong with it."""
    if not given or not Path(given).is_dir():
        return [(given, "")]
    return list(_in_folder(Path(given))) or [(given, "")]


def _in_folder(top: Path) -> Iterator[tuple[str, str]]:
    """Look through a folder and what is below it, each folder once: links may lead back."""
    seen: set[tuple[int, int]] = set()
    waiting = [top]
    while waiting:
        folder = waiting.pop()
        try:
            status = folder.stat()
            if (status.st_dev, status.st_ino) in seen:
                continue
            seen.add((status.st_dev, status.st_ino))
            entries = sorted(one for one in folder.iterdir() if not one.name.startswith("."))
            own = _own(folder, entries)
            if not own:
                waiting += [one for one in reversed(entries) if one.is_dir()]
        except OSError as error:
            yield str(folder), reason_of(error)
        else:
            yield from ((str(one), "") for one in own)


def _own(folder: Path, entries: Sequence[Path]) -> list[Path]:
    """Give the sources that lie in a folder itself; it alone where it is one."""
    endings = {one.suffix.lower() for one in entries}
    if RECORDING in endings:
        return [one for one in entries if one.suffix.lower() == RECORDING
                or (one.suffix.lower() == FRAME and _may_be_frame(one))]
    if FRAME in endings or folder / "depth" in entries:
        return [folder]
    return [folder] if is_of_pairs(folder) else []


def is_of_pairs(folder: Path) -> bool:
    """Say whether a folder has image pairs in a layout that is known."""
    try:
        FolderSource(folder).close()
    except (CaptureError, OSError):
        return False
    return True


def _may_be_frame(path: Path) -> bool:
    """Say whether an archive holds a depth image, as no face does, or cannot be read."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "depth.npy" in archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError):
        return True


def _names(uris: Sequence[str]) -> list[str]:
    """Name each source so that no two have the same name, on file systems without case, too."""
    paths = [Path(ReplayOptions.split(uri)[0]) for uri in uris]
    paths = [path.resolve() if path.is_dir() else path.absolute() for path in paths]
    names = [(path.name if path.is_dir() else path.stem) or "face" for path in paths]
    often = Counter(name.casefold() for name in names)
    names = [f"{path.parent.name}_{name}" if often[name.casefold()] > 1 and path.parent.name
             else name for path, name in zip(paths, names, strict=True)]
    taken: set[str] = set()
    for at, name in enumerate(names):
        number, free = 2, name
        while free.casefold() in taken:
            number, free = number + 1, f"{name}-{number}"
        taken.add(free.casefold())
        names[at] = free
    return names
