"""What `denseface compare` is given: faces, meshes, captures of the hub, frames, recordings."""

import re
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from denseface.capture import RgbdFrame
from denseface.capture.burst import fuse
from denseface.recon import Face, ReconstructionError, Settings, reconstruct
from denseface.service.errors import UsageError
from denseface.service.export import load_face
from denseface.service.export.reading import MESH_ENDINGS, read_mesh
from denseface.service.tools.comparison.surface import Surface
from denseface.service.tools.frames import FrameChoice, UnreadFrame, each_frame, read_frame
from denseface.service.tools.reconstruction.inputs import find_inputs
from denseface.validation import CAPTURE_ID

__all__ = ["Capture", "Reading", "is_face_file", "read_side"]

_FACE, _RECORDING = ".npz", ".oni"
_FACE_KEY, _FRAME_KEY = "dense_points.npy", "depth.npy"
"""Of what a `.npz` holds, where it is a face and where it is a frame."""
_FEWEST_POINTS = 500
"""A mesh with fewer is no face."""
_FRAMES = 8
"""Frames of a recording that are made one, where nothing is said."""


class Capture(NamedTuple):
    """One face of a side."""

    name: str
    """Where it comes from, for people."""
    surface: Surface
    face: Face | None
    """None of a mesh."""


class Reading(NamedTuple):
    """How a side is read."""

    choice: FrameChoice
    settings: Settings
    """Of the reconstruction of frames."""
    frames: int | None
    """How many consecutive frames of a recording become one capture; None for 8, or all of a
    shorter one."""
    captures: int
    """At most so many of a recording, spread over it."""
    fetch: Callable[[str], Face]
    """Asks the hub for the face of a capture."""


def read_side(given: str, reading: Reading, doubt: Callable[[str], object]) -> list[Capture]:
    """Read a file, a folder, or a capture of the hub by its id: one capture or several.

    A folder stands for all faces, meshes and recordings in it; one of frames for one recording.

    Parameters
    ----------
    doubt : told of what is left out, a line each

    Raises
    ------
    UsageError, CaptureError, FormatError, ServiceError
        It is none of these, or cannot be read.
    ReconstructionError
        There is no face in it.
    """
    path = Path(given)
    if path.is_dir():
        files = [one for one in sorted(path.iterdir())
                 if not one.name.startswith(".") and one.is_file() and _kind(one)]
        if not files:
            raise UsageError(f"{given}: no faces, meshes, frames or recordings in it "
                             f"({' '.join(MESH_ENDINGS)} {_RECORDING})")
        kinds = {_kind(one) for one in files}
        if kinds == {"frame"}:
            return _recording(given, reading, doubt)
        if "frame" in kinds:
            raise UsageError(f"{given}: frames beside other files: expected faces, meshes and "
                             "recordings, or frames alone")
        return [capture for one in files for capture in _file(one, reading, doubt)]
    if path.is_file() and _kind(path):
        return _file(path, reading, doubt)
    if not path.exists() and re.fullmatch(CAPTURE_ID, given) and not path.suffix:
        face = reading.fetch(given)
        return [Capture(f"capture {given}", Surface.of_face(face), face)]
    if not path.exists() and path.suffix.lower() in (*MESH_ENDINGS, _RECORDING):
        raise UsageError(f"{given}: no such file")
    raise UsageError(f"{given or repr(given)}: expected a face or mesh ({' '.join(MESH_ENDINGS)}), "
                     "a frame, a recording (.oni), a folder of them, or a capture's id")


def is_face_file(path: Path) -> bool:
    """Say whether a file is a face, not a frame: by what a `.npz` holds."""
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as file:
        return _FRAME_KEY not in file.namelist()
    return True


def _kind(path: Path) -> str:
    ending = path.suffix.lower()
    if ending == _FACE:
        return "face" if is_face_file(path) else "frame"
    return "recording" if ending == _RECORDING else "mesh" if ending in MESH_ENDINGS else ""


def _file(path: Path, reading: Reading, doubt: Callable[[str], object]) -> list[Capture]:
    kind = _kind(path)
    if kind == "face":
        face = load_face(path)
        return [Capture(str(path), Surface.of_face(face), face)]
    if kind == "mesh":
        mesh = read_mesh(path)
        if len(mesh.points) < _FEWEST_POINTS:
            raise UsageError(f"{path}: {len(mesh.points)} points, expected a face of "
                             f"{_FEWEST_POINTS} or more")
        return [Capture(str(path), Surface.of_mesh(mesh.points, mesh.triangles), None)]
    if kind == "frame":
        frame = read_frame(str(path), 0, reading.choice).frame
        return [_reconstructed(str(path), frame, reading)]
    return _recording(str(path), reading, doubt)


def _recording(given: str, reading: Reading, doubt: Callable[[str], object]) -> list[Capture]:
    """Reconstruct bursts of a recording, spread over it."""
    inputs = find_inputs([given])
    if len(inputs) != 1 or inputs[0].problem:
        raise UsageError(f"{given}: {inputs[0].problem if inputs else 'no recording or frames'}")
    found: list[Capture] = []
    refused: ReconstructionError | None = None
    for name, frames in _bursts(inputs[0].uri, reading, doubt):
        try:
            found.append(_reconstructed(name, fuse(frames), reading))
        except ReconstructionError as error:
            refused = error
            doubt(str(error))
    if not found:
        raise refused or UsageError(f"{given}: no frame in it can be read")
    return found


def _bursts(
    uri: str, reading: Reading, doubt: Callable[[str], object]
) -> Iterator[tuple[str, list[RgbdFrame]]]:
    """Give the frames of each capture, with its name."""
    read = each_frame(uri, reading.choice)
    first = next(read)
    total = first.total
    size = reading.frames or min(_FRAMES, total or _FRAMES)
    wanted = None
    if total is not None:
        bursts = max(total // size, 1)
        wanted = set(np.linspace(0, bursts - 1, min(bursts, reading.captures)).round().astype(int))

    def every() -> Iterator[tuple[int, RgbdFrame]]:
        for one in chain([first], read):
            if isinstance(one, UnreadFrame):
                doubt(f"{uri}, frame {one.number}: {one.problem}")
            else:
                yield one.number, one.frame

    taken = 0
    for burst, group in groupby(every(), lambda one: one[0] // size):
        if wanted is not None and burst not in wanted:
            continue
        frames = [frame for _, frame in group]
        if len(frames) < size and (taken or (total is not None and total >= size)):
            continue
        if reading.frames and len(frames) < reading.frames:
            raise UsageError(f"{uri}: has {len(frames)} frames, --frames asks for "
                             f"{reading.frames}")
        yield f"{uri}, frames {burst * size} to {burst * size + len(frames) - 1}", frames
        taken += 1
        if taken == reading.captures:
            return


def _reconstructed(name: str, frame: RgbdFrame, reading: Reading) -> Capture:
    try:
        face = reconstruct(frame, reading.settings)
    except ReconstructionError as error:
        raise type(error)(f"{name}: {error}") from error
    return Capture(name, Surface.of_face(face), face)
