"""Open3D's ray casting, array to array."""

from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

__all__ = ["Caster"]

Floats = NDArray[np.float32]


class Caster:
    """Triangle meshes that rays can be cast at, (n, 3) mm all in one frame."""

    def __init__(self) -> None:
        self._scene: Any = o3d.t.geometry.RaycastingScene()

    def add(self, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> None:
        """Add a mesh: (n, 3) vertices, mm, and (m, 3) faces; the first is number 0."""
        self._scene.add_triangles(np.ascontiguousarray(vertices, np.float32),
                                  np.ascontiguousarray(faces, np.uint32))

    def cast(
        self, origin: NDArray[np.floating], directions: NDArray[np.floating]
    ) -> tuple[Floats, NDArray[np.int32], NDArray[np.int64], Floats]:
        """Cast rays from one point, (3,) mm, or one for each, (n, 3), along (n, 3) directions.

        Returns
        -------
        distance : (n,) float32, in units of the direction's length, inf where nothing is hit
        mesh : (n,) int32, number of the mesh, -1 where nothing is hit
        triangle : (n,) int64, index into that mesh's faces
        weights : (n, 3) float32, barycentric
        """
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origin, directions
        found = self._scene.cast_rays(_tensor(rays))
        distance = found["t_hit"].numpy()
        hit = np.isfinite(distance)
        u, v = found["primitive_uvs"].numpy().T
        return (distance, np.where(hit, found["geometry_ids"].numpy().astype(np.int32), -1),
                np.where(hit, found["primitive_ids"].numpy(), 0).astype(np.int64),
                np.stack([1 - u - v, u, v], axis=-1))

    def blocked(self, start: Floats, ways: Floats, reach: float) -> NDArray[np.bool_]:
        """Say which rays, (n, 3) start and (n, 3) way, meet anything within `reach` ways."""
        rays = _tensor(np.concatenate([start, ways], axis=1).astype(np.float32))
        return np.asarray(self._scene.test_occlusions(rays, 0.0, reach).numpy(), np.bool_)

    def distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Give how far points, (n, 3) mm, are from the nearest surface: (n,) float64, mm."""
        query = _tensor(np.ascontiguousarray(points, np.float32))
        return np.asarray(self._scene.compute_distance(query).numpy(), np.float64)


def _tensor(array: Floats) -> Any:
    make: Any = o3d.core.Tensor
    return make(array)
