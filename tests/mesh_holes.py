"""What is wrong with a triangle mesh of a surface: holes, edges, degenerate triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

__all__ = ["MeshFaults", "mesh_faults"]


@dataclass(frozen=True)
class MeshFaults:
    """Counts; all of them are 0 in a sound mesh of a surface with one outline for each part."""

    holes: int
    """Inner boundary loops, parts taken together: parts - (vertices - edges + triangles), which
    for a mesh that lies over a plane is the number of holes (Euler, Poincare)."""
    non_manifold: int
    """Edges of more than two triangles."""
    flipped: int
    """Edges that two triangles pass in the same direction."""
    degenerate: int
    """Triangles without area."""


def mesh_faults(points: NDArray[np.floating], triangles: NDArray[np.integer]) -> MeshFaults:
    """Count them: (n, 3) points, any unit, (t, 3) triangles, which lie over a plane."""
    one = triangles.astype(np.int64)
    start, end = one.ravel(), one[:, [1, 2, 0]].ravel()
    # Edges as numbers: sorting rows takes fifty times as long.
    _, same_way = np.unique(start * len(points) + end, return_counts=True)
    edges, uses = np.unique(
        np.minimum(start, end) * len(points) + np.maximum(start, end), return_counts=True)
    used = np.unique(triangles)
    _, part = connected_components(coo_array(
        (np.ones(len(edges)), np.divmod(edges, len(points))), shape=(len(points), len(points))))
    a, b, c = np.moveaxis(points[triangles].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return MeshFaults(
        holes=len(np.unique(part[used])) - (len(used) - len(edges) + len(triangles)),
        non_manifold=int((uses > 2).sum()), flipped=int((same_way > 1).sum()),
        degenerate=int((area <= 0).sum()))
