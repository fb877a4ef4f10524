"""The model: a mean face, and the modes in which faces differ from it.

Made by `python -m bench.prior_basis` from ICT-FaceKit (MIT, `LICENSE-ICT-FaceKit.txt`): the part of
a head that a camera in front can see, neck and ears left out.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles, Floats, Ints

__all__ = ["Basis", "basis"]

_FILE = Path(__file__).with_name("basis.npz")


class Basis(NamedTuple):
    """A face is `vertices + modes @ weights`, the weights independent unit normals.

    Attributes
    ----------
    vertices : (n, 3) float32, mm, about their mean; x right, y down, z forward, facing -z. The
        first few, however many, lie far from each other
    triangles : (m, 3) int32, vertices, clockwise in the camera's image
    normals : (n, 3) float32, unit length, outward
    modes : (n, 3, k) float32, mm, one standard deviation each, the largest first
    missing_mm : root mean square along an axis of what further modes would add
    """

    vertices: Floats
    triangles: Ints
    normals: Floats
    modes: Floats
    missing_mm: float

    def points(self, weights: Doubles, count: int | None = None) -> Floats:
        """Give the first points, or all, of the face with these weights, (n, 3) float32, mm."""
        # One product of a matrix: over three axes numpy takes one for each point.
        flat = self.modes[:count].reshape(-1, len(weights)) @ weights.astype(np.float32)
        return self.vertices[:count] + flat.reshape(-1, 3)


@cache
def basis() -> Basis:
    """Load the model that is shipped; its arrays are shared and not to be changed."""
    with np.load(_FILE, allow_pickle=False) as data:
        vertices, triangles = data["vertices"], data["triangles"].astype(np.int32)
        modes = data["scales"][:, None, None] * data["modes"].astype(np.float32)
        missing_mm = float(data["missing_mm"])
    modes = np.ascontiguousarray(np.moveaxis(modes, 0, 2))
    normals = _normals(vertices, triangles)
    for array in (vertices, triangles, normals, modes):
        array.flags.writeable = False
    return Basis(vertices, triangles, normals, modes, missing_mm)


def _normals(vertices: Floats, triangles: Ints) -> Floats:
    """Give the vertices' normals, means of their triangles' by area."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    found = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(found, triangles[:, corner], across)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True), np.float32)
