"""The compact `.glb`: whole numbers in place of floats, packed by EXT_meshopt_compression.

three.js, Babylon.js and model-viewer read it, with meshoptimizer's decoder; most desktop programs
do not.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.mesh import FaceMesh, face_mesh
from denseface.service.export.models.gltf import ARRAY, FLIP, INDICES, MM_PER_M, Gltf
from denseface.service.export.models.meshopt import (
    encode_attributes,
    encode_triangles,
    octahedral,
    strip_order,
)
from denseface.service.export.models.texture import textured
from denseface.service.export.options import ExportOptions

__all__ = ["to_compact_glb"]

_UNITS_PER_STEP = 7
"""Of a grid step: one step to the right is 14 when it is folded, the largest number of half a byte.
"""
_MOST = 65535
"""Largest number of 16 bits."""
_NORMAL_BITS = 10
"""Of the two numbers of a normal: a quarter of a degree off at most."""


def to_compact_glb(face: Face, options: ExportOptions) -> bytes:
    """Give the bytes of a `.glb` file with the mesh of a face: metres, y up.

    Points are rounded to a seventh of a grid step (more, where the face is so large that this does
    not fit into 16 bits), normals to a quarter of a degree. Colours are a texture: the points' own,
    a pixel for each place of the grid, or the photograph where one is asked for. In eight bits of
    linear light, shadows would show steps.
    """
    painted = textured(face_mesh(face.dense, options), options.texture or "points")
    mesh, size = painted.mesh, np.array(painted.size)
    units = min(painted.parts, _MOST // int(size.max()))
    places = np.clip(np.rint((painted.uv * size - 0.5) * units), 0, _MOST)
    triangles, order = strip_order(mesh.triangles)
    positions, unit_mm, low = _rounded(mesh)
    gltf = Gltf(face.report, options.copyright)
    gltf.require("KHR_mesh_quantization")
    named = {
        "POSITION": _packed(gltf, positions[order], "VEC3", bounds=True),
        "NORMAL": _normals(gltf, mesh.normals[order] * FLIP),
        "TEXCOORD_0": _packed(gltf, places[order].astype("<u2"), "VEC2")}
    indices = gltf.packed(
        triangles.astype("<u4").ravel(), "SCALAR", INDICES, encode_triangles(triangles),
        mode="TRIANGLES", stride=4, count=triangles.size)
    gltf.texture(painted.jpeg, {"offset": (0.5 / size).tolist(),
                           "scale": (1 / (size * units)).tolist()})
    unit = unit_mm / MM_PER_M
    return gltf.pack(named, indices, {
        "translation": (low / MM_PER_M).tolist(), "scale": [unit, unit, unit]})


def _rounded(mesh: FaceMesh) -> tuple[NDArray[np.uint16], float, NDArray[np.float64]]:
    """Give points in units from a corner, the unit and the corner, mm; y up, z to the viewer."""
    points = mesh.points.astype(np.float64) * FLIP
    low = points.min(axis=0)
    unit = max(mesh.step_mm / _UNITS_PER_STEP, float(np.ptp(points, axis=0).max()) / _MOST)
    return np.rint((points - low) / unit).astype("<u2"), unit, low


def _packed(gltf: Gltf, array: NDArray[np.uint16], kind: str, *, bounds: bool = False) -> int:
    """Add whole numbers, each row filled up to a multiple of 4 bytes."""
    filled = np.zeros((len(array), -(-array.shape[1] // 2) * 2), "<u2")
    filled[:, :array.shape[1]] = array
    rows = filled.view(np.uint8)
    return gltf.packed(array, kind, ARRAY, encode_attributes(rows), mode="ATTRIBUTES",
                       stride=rows.shape[1], count=len(rows), bounds=bounds)


def _normals(gltf: Gltf, normals: NDArray[np.float32]) -> int:
    coded = octahedral(normals, _NORMAL_BITS).astype("<i2")
    rows = coded.view(np.uint8)
    return gltf.packed(coded[:, :3], "VEC3", ARRAY, encode_attributes(rows), mode="ATTRIBUTES",
                       stride=rows.shape[1], count=len(rows), packing="OCTAHEDRAL",
                       normalized=True)
