"""Faces to files, the ending picks the format; `.npz` is read back.

======== =========================================================================================
`.ply`   dense cloud, binary: x y z (float), nx ny nz (float), red green blue (uchar), sigma (float:
         the standard error along the viewing ray), millimetres
`.pcd`   the same for PCL
`.npz`   the whole face: both clouds, normals, sigma, grid, report
`.obj`   dense mesh with vertex colours and normals, millimetres, camera frame
`.stl`   dense mesh without colours, millimetres, camera frame
`.glb`   dense mesh, glTF 2.0: metres, y up, as that format demands
======== =========================================================================================
"""

import io
import os
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from pydantic import ValidationError

from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.service.errors import FormatError, first_error, reason_of
from denseface.service.export.glb import glb
from denseface.service.export.mesh import triangulate
from denseface.service.runtime.files import write_atomically

__all__ = ["check_ending", "load_face", "save_face"]

_ARRAYS = ("initial_points", "initial_colors", "dense_points", "dense_colors", "dense_normals",
           "dense_sigma", "dense_cells", "grid_shape", "grid_step_mm", "report")


def save_face(face: Face, path: str | Path) -> None:
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
    _WRITERS[check_ending(path)](face, path)


def check_ending(path: str | Path) -> str:
    """Give the ending of a file that can be written.

    Raises
    ------
    FormatError
        One line that names the endings known.
    """
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        raise FormatError(f"{path}: ending {ending or 'missing'}, expected one of "
                          f"{' '.join(_WRITERS)}")
    return ending


def load_face(path: str | Path) -> Face:
    """Read a `.npz` that `save_face` wrote.

    Raises
    ------
    FormatError
        Where the file is missing or no such file.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            of = {name: file[name] for name in _ARRAYS}
        rows, columns = of["grid_shape"].tolist()
        return Face(
            PointCloud(of["initial_points"], of["initial_colors"]),
            DenseCloud(of["dense_points"], of["dense_colors"], of["dense_normals"],
                       of["dense_sigma"], of["dense_cells"], (rows, columns),
                       float(of["grid_step_mm"])),
            Report.model_validate_json(str(of["report"])))
    except ValidationError as error:
        field, message = first_error(error)
        raise FormatError(f"{path}: report: {field}: {message}") from error
    except (OSError, EOFError, ValueError, TypeError, LookupError, BadZipFile, zlib.error) as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error


def _npz(face: Face, path: Path) -> None:
    initial, dense = face.initial, face.dense
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, initial_points=initial.points, initial_colors=initial.colors,
        dense_points=dense.points, dense_colors=dense.colors, dense_normals=dense.normals,
        dense_sigma=dense.sigma, dense_cells=dense.cells,
        grid_shape=np.array(dense.grid_shape, np.int64),
        grid_step_mm=np.float64(dense.grid_step_mm), report=face.report.model_dump_json())
    write_atomically(path, [buffer.getvalue()], durable=False)


def _cloud(face: Face, path: Path) -> None:
    import open3d as o3d

    tensor = o3d.core.Tensor.from_numpy
    dense = face.dense
    cloud = o3d.t.geometry.PointCloud(tensor(_own(dense.points)))
    cloud.point.normals = tensor(_own(dense.normals))
    cloud.point.colors = tensor(_own(dense.colors))
    cloud.point.sigma = tensor(_own(dense.sigma[:, None]))
    _through(path, lambda name: o3d.t.io.write_point_cloud(name, cloud))


def _mesh(face: Face, path: Path) -> None:
    import open3d as o3d

    vector = o3d.utility.Vector3dVector
    dense = face.dense
    mesh = o3d.geometry.TriangleMesh(
        vector(dense.points.astype(np.float64)), o3d.utility.Vector3iVector(triangulate(dense)))
    mesh.vertex_colors = vector(dense.colors / 255.0)
    mesh.vertex_normals = vector(dense.normals.astype(np.float64))
    if path.suffix.lower() == ".stl":
        mesh.compute_triangle_normals()
    _through(path, lambda name: o3d.io.write_triangle_mesh(name, mesh))


def _glb(face: Face, path: Path) -> None:
    write_atomically(path, [glb(face.dense, triangulate(face.dense))], durable=False)


def _own(array: Any) -> Any:
    """Give a copy that Open3D may share: it takes no read-only memory."""
    return np.array(array, order="C")


def _through(path: Path, write: Callable[[Path], bool]) -> None:
    """Have a library write beside, then rename; it picks the format by the ending."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix.lower()}")
    try:
        if not write(temporary):
            raise OSError(f"{path}: could not be written")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


_WRITERS: dict[str, Callable[[Face, Path], None]] = {
    ".ply": _cloud, ".pcd": _cloud, ".npz": _npz, ".obj": _mesh, ".glb": _glb, ".stl": _mesh,
}
