"""Faces to files, the ending picks the format; `.npz` is read back.

A further format is one function and one row of `FORMATS`. Its module is imported where a file is
written: the command line names the formats, and is to be quick.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.arguments import as_path, expect
from denseface.service.errors import FormatError

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["FORMATS", "check_ending", "face_bytes", "load_face", "save_face"]


def save_face(face: "Face", path: str | Path, *, mode: int | None = None) -> None:
    """Write a face in the format that the path's ending names.

    The file is either whole or not there, what was of that name before is left then; folders that
    are missing are made. Its mode is `mode`, or 666 less the umask.

    Raises
    ------
    FormatError
        Where the ending is not known.
    TypeError
        Where `face` is no face, or `path` no path.
    ServiceError
        Where the file would be in a hub's data folder.
    OSError
        Where the file cannot be written: it names the file.
    """
    from denseface.files import write_whole
    from denseface.recon.face import Face
    from denseface.service.runtime.files import check_outside_hub

    expect("face", face, Face, "save_face(face, path)")
    path = as_path(path)
    ending = check_ending(path)
    check_outside_hub(path)
    write_whole(path, [face_bytes(face, ending)], mode=mode)


def face_bytes(face: "Face", ending: str) -> bytes:
    """Give the bytes of a face's file with an ending of `FORMATS`."""
    module, name = FORMATS[ending].split(":")
    data: bytes = getattr(import_module(f"denseface.service.export.{module}"), name)(face)
    return data


def load_face(path: str | Path) -> "Face":
    """Read a `.npz` that `save_face` wrote.

    Raises
    ------
    FormatError
        Where the file is missing, damaged, or no such file.
    """
    path = as_path(path)
    if path.suffix.lower() != _WHOLE:
        raise FormatError(
            f"{path}: faces are read back from {_WHOLE} alone: "
            f"save_face(face, '{path.stem or 'face'}{_WHOLE}') keeps the whole face")
    from denseface.service.export._npz import from_npz

    return from_npz(path)


def check_ending(path: str | Path) -> str:
    """Give the ending of a file that can be written.

    Raises
    ------
    FormatError
        One line that names the endings known.
    """
    ending = Path(path).suffix.lower()
    if ending not in FORMATS:
        raise FormatError(f"{path}: ending {ending or 'missing'}, expected one of "
                          f"{' '.join(FORMATS)}")
    return ending


_WHOLE = ".npz"
"""Of the files that keep the whole face."""

FORMATS = {
    ".ply": "cloud:to_ply",
    ".pcd": "cloud:to_pcd",
    ".npz": "_npz:to_npz",
    ".obj": "mesh:to_obj",
    ".glb": "glb:to_glb",
    ".stl": "mesh:to_stl",
}
"""Which function of which module of `service.export` makes a face's bytes, by a file's ending.

`.ply`, `.pcd`: the dense cloud, binary, mm, camera frame: x y z, nx ny nz (float), red green blue
(uchar), sigma (float: standard error along the viewing ray). `.npz`: the whole face, read back by
`load_face`. `.obj`, `.stl`: the dense mesh, mm, camera frame. `.glb`: the same as glTF 2.0: metres,
y up. Each says where the face comes from, as far as it can (`service.export.provenance`).
"""
