"""Faces to files, the ending picks the format; `.npz` is read back.

A further format is one function and one row of `FORMATS`. Its module is imported where a file is
written: the command line names the formats, and is to be quick.
"""

from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.arguments import as_path, expect
from denseface.missing import explained
from denseface.service.errors import FormatError, UsageError
from denseface.service.export.options import PLAIN, ExportOptions

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["FORMATS", "beside", "check_ending", "check_options", "face_bytes", "load_face",
           "save_face"]


def save_face(
    face: "Face", path: str | Path, *, mode: int | None = None, options: ExportOptions = PLAIN
) -> None:
    """Write a face in the format that the path's ending names.

    The file is either whole or not there, what was of that name before is left then; folders that
    are missing are made. Its mode is `mode`, or 666 less the umask. A textured `.obj` has its
    material and its texture in files beside it (`beside`), which are there first.

    Raises
    ------
    FormatError
        Where the ending is not known.
    UsageError
        Where the format cannot have what `options` ask for.
    TypeError
        Where `face` is no face, or `path` no path.
    ServiceError
        Where the file would be in a hub's data folder.
    MissingPackageError
        Where `options` ask for what takes a package that is not installed.
    OSError
        Where the file cannot be written: it names the file.
    """
    from denseface.files import write_all
    from denseface.recon.face import Face
    from denseface.service.runtime.files import check_outside_hub

    expect("face", face, Face, "save_face(face, path)")
    path = as_path(path)
    ending = check_ending(path)
    check_options(path, options.asked)
    check_outside_hub(path)
    with explained():  # a client alone writes every format, but not each with all options
        if beside(path, textured=options.texture is not None):
            from denseface.service.export.models.obj import with_material

            files = with_material(face, path, options)
        else:
            files = {path: face_bytes(face, ending, options)}
    write_all(files, mode=mode)


def beside(path: str | Path, *, textured: bool = False) -> tuple[Path, ...]:
    """Give the further files that `save_face` writes: what a textured `.obj` names."""
    path = Path(path)
    if not textured or path.suffix.lower() not in _BESIDE:
        return ()
    from denseface.service.export.models.material import beside_obj

    return beside_obj(path)


def face_bytes(face: "Face", ending: str, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of a face's file with an ending of `FORMATS`; an `.obj` without texture."""
    module, name = FORMATS[ending].split(":")
    function = getattr(import_module(f"denseface.service.export.{module}"), name)
    data: bytes = function(face, options) if ending in _OPTIONS else function(face)
    return data


def check_options(path: str | Path, asked: Collection[str]) -> None:
    """Check that a file can be written as it is asked for.

    Parameters
    ----------
    asked : names of `ExportOptions` that differ from what is written without them

    Raises
    ------
    UsageError
        One line that names what its format cannot have.
    """
    ending = check_ending(path)
    for name in sorted({*asked} - _OPTIONS.get(ending, frozenset())):
        able = " or ".join(one for one, names in _OPTIONS.items() if name in names)
        what = "printing (solid, wall, height)" if name == "printing" else name
        raise UsageError(f"{path}: {what} is for {able}, not {ending}")


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

_OPTIONS = {
    ".glb": frozenset({"holes", "texture", "compact", "copyright"}),
    ".obj": frozenset({"holes", "texture"}),
    ".stl": frozenset({"holes", "printing"}),
    ".3mf": frozenset({"printing"}),
}
"""What each format can have of `ExportOptions`; its function takes them then."""
_BESIDE = {".obj"}
"""Formats that have a texture in files beside them."""

FORMATS = {
    ".ply": "cloud:to_ply",
    ".pcd": "cloud:to_pcd",
    ".npz": "_npz:to_npz",
    ".obj": "models.obj:to_obj",
    ".glb": "models.glb:to_glb",
    ".stl": "printing.stl:to_stl",
    ".3mf": "printing.threemf:to_3mf",
    ".png": "render:render",
    ".webp": "turning.animation:to_webp",
    ".mp4": "turning.animation:to_mp4",
}
"""Which function of which module of `service.export` makes a face's bytes, by a file's ending.

`.ply`, `.pcd`: the dense cloud, binary, mm, camera frame: x y z, nx ny nz (float), red green blue
(uchar), sigma (float: standard error along the viewing ray). `.npz`: the whole face, read back by
`load_face`. `.obj`: the dense mesh, mm, camera frame. `.glb`: the same as glTF 2.0: metres, y up.
`.stl`, `.3mf`: a solid to be printed, mm, z up from the bed. `.png`: a picture. `.webp`, `.mp4`:
the face turning to and fro. What is in each, and what reads it: `docs/files.md`. Each says where
the face comes from, as far as it can (`service.export.provenance`).
"""
