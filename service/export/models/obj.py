"""Wavefront's `.obj`: mm, camera frame, a colour for each point, or a texture by an `.mtl`.

Never both: programs that know colours of points would multiply them, and others (trimesh) leave
them out where there is a material.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.mesh import FaceMesh, face_mesh
from denseface.service.export.models.material import beside_obj, material
from denseface.service.export.options import PLAIN, ExportOptions
from denseface.service.export.provenance import comments

__all__ = ["to_obj", "with_material"]


def to_obj(face: Face, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of an `.obj` file that stands alone: with a colour for each point."""
    return _obj(face, face_mesh(face.dense, options), None, "")


def with_material(face: Face, path: Path, options: ExportOptions) -> dict[Path, bytes]:
    """Give the bytes of an `.obj` with a texture, and of the files that it names, itself last.

    UsageError where there is no texture to be had (`ExportOptions.texture`).
    """
    from denseface.service.export.models.texture import textured  # OpenCV is for this alone

    library, image = beside_obj(path)
    painted = textured(face_mesh(face.dense, options), options.texture or "points")
    return {image: painted.jpeg, library: material(comments(face.report), image.name),
            path: _obj(face, painted.mesh, painted.uv, library.name)}


def _obj(
    face: Face, mesh: FaceMesh, uv: NDArray[np.float64] | None, library: str
) -> bytes:
    # Numbers of vertices, from 1; a vertex's normal and texture coordinates have the same.
    faces = mesh.triangles + 1
    parts = [f"# by denseface, mm: {len(mesh.points)} vertices\n",
             *(f"# {line}\n" for line in comments(face.report)),
             f"mtllib {library}\n" if library else "", "o face\n"]
    if uv is None:
        parts += [_lines("v %.4f %.4f %.4f %.6g %.6g %.6g\n",
                         np.hstack([mesh.points, mesh.colors / 255])),
                  _lines("vn %.6g %.6g %.6g\n", mesh.normals)]
        corner, times = "%d//%d", 2
    else:
        # The origin of an image is its lower left corner here.
        upward = np.array([0, 1]) + np.array([1, -1]) * uv
        parts += [_lines("v %.4f %.4f %.4f\n", mesh.points), _lines("vt %.7f %.7f\n", upward),
                  _lines("vn %.6g %.6g %.6g\n", mesh.normals)]
        corner, times = "%d/%d/%d", 3
    return "".join([*parts, "usemtl face\n" if library else "",
                    _lines(f"f {corner} {corner} {corner}\n",
                           np.repeat(faces, times, axis=1))]).encode()


def _lines(line: str, rows: NDArray[np.floating | np.integer]) -> str:
    """Format a row to a line."""
    return line * len(rows) % tuple(rows.ravel().tolist())
