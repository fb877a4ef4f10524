"""One way to read a mesh or a cloud, whatever its format; what is wrong with a file is one line.

Own readers, not trimesh's: files come from outside, no count that a header names is believed before
the bytes are there, and a client needs no further library for it.
"""

import struct
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.arguments import as_path
from denseface.files import read_bounded
from denseface.service.errors import FormatError, reason_of

__all__ = ["MESH_ENDINGS", "Mesh", "RawMesh", "read_mesh"]

_MAX_BYTES = 2**28
"""Of a file."""
_FARTHEST_MM = 1e7
"""A coordinate beyond is none of a face: the file is damaged or of another kind."""


class Mesh(NamedTuple):
    """What a file holds."""

    points: NDArray[np.float32]
    """(n, 3), mm, depth camera frame: x right, y down, z forward."""
    triangles: NDArray[np.int32] | None
    """(t, 3), rows of `points`; None of a cloud."""
    colors: NDArray[np.uint8] | None
    """(n, 3), RGB: the points' own, else those of a `.glb`'s texture; None where the file has none.
    A texture beside an `.obj` is not read."""


class RawMesh(NamedTuple):
    """What a reader of a format found, not looked at yet; in mm and the camera frame."""

    points: NDArray[np.floating]
    triangles: NDArray[np.integer] | None = None
    colors: NDArray[np.uint8] | None = None


_READERS = {
    ".ply": "_ply:from_ply",
    ".pcd": "_pcd:from_pcd",
    ".obj": "_obj:from_obj",
    ".stl": "_stl:from_stl",
    ".glb": "_glb:from_glb",
}
"""Which function of which module here reads a file's bytes, by its ending."""
_FACE = ".npz"

MESH_ENDINGS = (*_READERS, _FACE)
"""Of files that `read_mesh` reads."""


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh or a cloud: `.ply` `.pcd` `.obj` `.stl` `.glb`, or `.npz` of `save_face`.

    Lengths are taken for millimetres in the depth camera's frame, as files of this program have
    them; a `.glb`, which is in metres and y up by its format, is turned back, and so is an `.stl`
    that was made for printing. Polygons become
    triangles that fan out from their first corner, the corners of an `.stl` that are in one place
    one point. Points of a `.pcd` that are not finite are left out: they stand for none.

    Raises
    ------
    FormatError
        The ending is none of these, or the file is missing, damaged, larger than 256 MiB, or uses
        what is not read: one line that names the file and what is wrong.
    TypeError
        Where `path` is no path.
    """
    path = as_path(path)
    ending = path.suffix.lower()
    if ending not in MESH_ENDINGS:
        raise FormatError(f"{path}: ending {ending or 'missing'}, expected one of "
                          f"{' '.join(MESH_ENDINGS)}")
    if ending == _FACE:
        return _of_face(path)
    try:
        data = read_bounded(path, _MAX_BYTES)
    except OSError as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error
    module, name = _READERS[ending].split(":")
    reader = getattr(import_module(f"{__package__}.{module}"), name)
    try:
        return _checked(reader(data))
    except FormatError:
        raise
    except (ValueError, OverflowError, struct.error) as error:
        raise FormatError(f"{path}: {_one_line(error)}") from error
    except (LookupError, TypeError, AttributeError, RecursionError) as error:
        # The parts of a file do not fit: a document that names what is not there.
        raise FormatError(f"{path}: damaged, or no {ending} file "
                          f"({type(error).__name__}: {_one_line(error)})") from error


def _of_face(path: Path) -> Mesh:
    from denseface.service.export.formats import load_face
    from denseface.service.export.mesh import triangulate

    dense = load_face(path).dense
    return Mesh(dense.points, triangulate(dense), dense.colors)


def _checked(raw: RawMesh) -> Mesh:
    """Give what a reader found as it is promised; ValueError where it is not so."""
    count = len(raw.points)
    if not count:
        raise ValueError("has no points")
    with np.errstate(over="ignore", invalid="ignore"):
        points = np.ascontiguousarray(raw.points, np.float32)
        wild = ~(np.abs(points) <= _FARTHEST_MM).all(axis=1)
    if wild.any():
        row = int(np.argmax(wild))
        raise ValueError(f"point {row} is at {points[row].tolist()}, expected finite lengths")
    triangles = None
    if raw.triangles is not None and len(raw.triangles):
        low, high = int(raw.triangles.min()), int(raw.triangles.max())
        if low < 0 or high >= count:
            raise ValueError(f"a triangle names point {high if low >= 0 else low} of {count}")
        triangles = np.ascontiguousarray(raw.triangles, np.int32)
    return Mesh(points, triangles, raw.colors)


def _one_line(error: BaseException) -> str:
    text = " ".join("".join(c if c.isprintable() else " " for c in str(error)).split())
    return text if len(text) <= 200 else f"{text[:200]}..."
