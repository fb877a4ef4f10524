"""The true lengths of a simulated head: by the definitions of `recon.measurement`, on its mesh."""

from functools import lru_cache

import numpy as np

from denseface.recon.face import DenseCloud
from denseface.recon.measurement import raw_lengths
from tests.simulator.caster import Caster
from tests.simulator.heads import load_head

__all__ = ["true_lengths"]

_STEP_MM = 0.5
_SIDE_MM, _UP_MM, _DOWN_MM = 110.0, 130.0, 150.0
"""What is looked at, around the head frame's origin."""
_BEHIND_MM = 110.0
"""What is farther behind is not of the face."""
_FROM_MM = -400.0
_EXACT_MM = 0.01


@lru_cache(maxsize=256)
def true_lengths(name: str) -> dict[str, float]:
    """Give the lengths, mm, by name, of the noise-free mesh as a whole, at a scale of 1."""
    return {length: raw.value for length, raw in raw_lengths(_seen_from_ahead(name)).items()}


def _seen_from_ahead(name: str) -> DenseCloud:
    """Give the mesh's foremost points on a fine grid, in the head's frame: nothing hides any."""
    head, caster = load_head(name), Caster()
    caster.add(head.vertices, head.faces)
    x, y = np.meshgrid(np.arange(-_SIDE_MM, _SIDE_MM, _STEP_MM),
                       np.arange(-_UP_MM, _DOWN_MM, _STEP_MM))
    origins = np.stack([x, y, np.full(x.shape, _FROM_MM)], axis=-1).reshape(-1, 3)
    distance, _, triangle, _ = caster.cast(origins, np.tile((0.0, 0.0, 1.0), (len(origins), 1)))
    z = distance.astype(np.float64) + _FROM_MM
    hit = z < _BEHIND_MM
    corners = head.vertices[head.faces[triangle[hit]]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= -np.linalg.norm(normals, axis=1, keepdims=True) * np.sign(normals[:, 2:])
    points = np.stack([x.ravel()[hit], y.ravel()[hit], z[hit]], axis=-1).astype(np.float32)
    return DenseCloud(
        points=points, colors=np.zeros(points.shape, np.uint8),
        normals=normals.astype(np.float32),
        sigma=np.full(len(points), _EXACT_MM, np.float32),
        cells=np.argwhere(hit.reshape(x.shape)).astype(np.int32), grid_shape=x.shape,
        grid_step_mm=_STEP_MM)
