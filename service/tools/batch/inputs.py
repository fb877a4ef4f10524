"""The sources below files and folders, one after the other: a folder of a million is not listed."""

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

from denseface.service.errors import UsageError
from denseface.service.tools.batch.parts import Part
from denseface.service.tools.reconstruction.inputs import (
    FRAME,
    RECORDING,
    SIDE,
    is_of_pairs,
    refuse_sensor,
)

__all__ = ["absolute", "input_names", "parts_of"]

_AT_ONCE = 10_000
"""Names of a folder that are in memory."""


def input_names(given: Sequence[str], known: Mapping[str, str]) -> dict[str, str]:
    """Give each input a name of its own, below which its faces are: absolute path -> name.

    Calibrations are passed over.

    Parameters
    ----------
    known : of earlier runs; they stay

    Raises
    ------
    UsageError
        A live sensor is named, nothing, or a file that is no recording or frame.
    """
    paths = []
    for one in given:
        refuse_sensor(one)
        if one.lower().endswith(SIDE):
            continue
        path = Path(absolute(one))
        if not one or not path.exists():
            raise UsageError(f"{one or 'INPUT'}: no such file or folder")
        if not path.is_dir() and path.suffix.lower() not in (RECORDING, FRAME):
            raise UsageError(f"{one}: expected a .npz or .oni file or a folder")
        paths.append(path)
    if not paths:
        raise UsageError("INPUT: calibrations alone, expected a frame, recording or folder")
    names = dict(known)
    taken = {name.casefold() for name in names.values()}
    often = Counter(_named(path).casefold() for path in dict.fromkeys(paths))
    for path in paths:
        if str(path) in names:
            continue
        own = _named(path)
        if often[own.casefold()] > 1 or own.casefold() in taken:
            own = f"{path.parent.name}_{own}" if path.parent.name else own
        number, name = 2, own
        while name.casefold() in taken:
            number, name = number + 1, f"{own}-{number}"
        taken.add(name.casefold())
        names[str(path)] = name
    return names


def absolute(path: str) -> str:
    """Give an absolute path, without `..`: links stay, as they may be others on other machines."""
    return os.path.abspath(path)  # noqa: PTH100


def parts_of(path: str, name: str, without: str = "") -> Iterator[Part]:
    """Give the sources of a file or folder, in the order in which its folder has them.

    A folder with recordings or frame files stands for each of these; one with image pairs in a
    layout that is known is one source; so does each folder below it. Names that begin with a dot
    are passed over; so are links to folders, which may lead back. What has no source at all is
    one, so that opening it says why.

    Parameters
    ----------
    without : a folder that is passed over, absolute: into which faces are written
    """
    if Path(path).is_dir():
        none = True
        for part in _in_folder(path, name, without):
            none = False
            yield part
        if none:
            yield Part(path, name, many=True)
    elif path.lower().endswith(RECORDING):
        yield Part(path, name, many=True)
    else:
        yield Part(path, name, many=False)


def _in_folder(folder: str, name: str, without: str) -> Iterator[Part]:
    try:
        if not _has_files(folder) and _is_of_pairs(folder):
            yield Part(folder, name, many=True)
            return
        with os.scandir(folder) as entries:
            # Sorted as far as memory allows: rows are looked up faster so, and people see it.
            while some := sorted(islice(entries, _AT_ONCE), key=lambda entry: entry.name):
                for entry in some:
                    if not entry.name.startswith("."):
                        yield from _of_entry(entry, name, without)
    except OSError:
        # Whoever opens it says why it cannot be read.
        yield Part(folder, name, many=True)


def _of_entry(entry: "os.DirEntry[str]", name: str, without: str) -> Iterator[Part]:
    ending = Path(entry.name).suffix
    if entry.is_dir(follow_symlinks=False):
        if entry.path != without:
            yield from _in_folder(entry.path, f"{name}/{entry.name}", without)
    elif ending.lower() == RECORDING:
        # With its ending: a folder of that name would be another source.
        yield Part(entry.path, f"{name}/{entry.name}", many=True)
    elif ending.lower() == FRAME:
        own = entry.name[:-len(ending)] if ending == FRAME else entry.name
        yield Part(entry.path, f"{name}/{own}", many=False)


def _has_files(folder: str) -> bool:
    with os.scandir(folder) as entries:
        return any(entry.name.lower().endswith((RECORDING, FRAME)) for entry in entries)


def _is_of_pairs(folder: str) -> bool:
    return is_of_pairs(Path(folder)) or (Path(folder) / "depth").is_dir()


def _named(path: Path) -> str:
    """Name an input as its file or folder is, without the ending."""
    return (path.name if path.is_dir() else path.stem) or "input"
