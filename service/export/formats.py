"""Faces to files, the ending picks the format; `.npz` is read back.

A further format is one function and one row of `FORMATS`. Modules that are slow to load are
imported where a file is written: the command line names the formats.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.errors import FormatError

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["FORMATS", "check_ending", "load_face", "save_face"]


def save_face(face: "Face", path: str | Path) -> None:
    """Write a face in the format that the path's ending names.

    The file is either whole or not there.

    Raises
    ------
    FormatError
        Where the ending is not known.
    OSError
        Where the file cannot be written.
    """
    path = Path(path)
    FORMATS[check_ending(path)](face, path)


def load_face(path: str | Path) -> "Face":
    """Read a `.npz` that `save_face` wrote.

    Raises
    ------
    FormatError
        Where the file is missing or no such file.
    """
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


def _write_cloud(face: "Face", path: Path) -> None:
    """Write points with normals, colours and standard errors."""
    import open3d as o3d

    tensor = o3d.core.Tensor.from_numpy  # shares memory, and takes none that is read-only
    dense = face.dense
    cloud = o3d.t.geometry.PointCloud(tensor(dense.points.copy()))
    cloud.point.normals = tensor(dense.normals.copy())
    cloud.point.colors = tensor(dense.colors.copy())
    cloud.point.sigma = tensor(dense.sigma[:, None].copy())
    _write_by_library(path, lambda name: o3d.t.io.write_point_cloud(name, cloud))


def _write_mesh(face: "Face", path: Path) -> None:
    """Write triangles with vertex colours and normals; `.stl` has normals of triangles alone."""
    import numpy as np
    import open3d as o3d

    from denseface.service.export.mesh import triangulate

    vector = o3d.utility.Vector3dVector
    dense = face.dense
    mesh = o3d.geometry.TriangleMesh(
        vector(dense.points.astype(np.float64)), o3d.utility.Vector3iVector(triangulate(dense)))
    mesh.vertex_colors = vector(dense.colors / 255.0)
    mesh.vertex_normals = vector(dense.normals.astype(np.float64))
    if path.suffix.lower() == ".stl":
        mesh.compute_triangle_normals()
    _write_by_library(path, lambda name: o3d.io.write_triangle_mesh(name, mesh))


def _write_glb(face: "Face", path: Path) -> None:
    from denseface.service.export.glb import to_glb
    from denseface.service.runtime.files import write_atomically

    write_atomically(path, [to_glb(face.dense)], durable=False)


def _write_npz(face: "Face", path: Path) -> None:
    from denseface.service.export._npz import to_npz
    from denseface.service.runtime.files import write_atomically

    write_atomically(path, [to_npz(face)], durable=False)


def _write_by_library(path: Path, write: Callable[[Path], bool]) -> None:
    """Have a library write a temporary file and rename it; it too goes by the ending."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix.lower()}")
    try:
        if not write(temporary):
            raise OSError(f"{path}: could not be written")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


FORMATS: dict[str, Callable[["Face", Path], None]] = {
    ".ply": _write_cloud,
    ".pcd": _write_cloud,
    ".npz": _write_npz,
    ".obj": _write_mesh,
    ".glb": _write_glb,
    ".stl": _write_mesh,
}
"""What writes the format of each ending.

`.ply`, `.pcd`: the dense cloud, binary, mm, camera frame: x y z, nx ny nz (float), red green blue
(uchar), sigma (float: standard error along the viewing ray). `.npz`: the whole face, read back by
`load_face`. `.obj`, `.stl`: the dense mesh, mm, camera frame. `.glb`: the same as glTF 2.0: metres,
y up.
"""
