"""The compact basis of `recon.prior`, from the full model of ICT-FaceKit (MIT).

Of the model's face what a camera in front can see is kept, with fewer triangles, holes of the eyes
closed. Its identities and expressions, weighted by unit normals, span a covariance of which the
largest principal components are kept (Karhunen-Loeve).
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from tests.simulator.heads import shared_folder
from tests.simulator.varied import MODEL

_TARGET = Path(__file__).resolve().parents[1] / "recon" / "prior" / "basis.npz"
_TRIANGLES = 3000
_MODES = 36
_EXPRESSION = 0.2
"""Standard deviation of an expression, of the whole one."""
_WINDOW = ((-80.0, 80.0), (-105.0, 100.0), (-140.0, -30.0))
"""x, y, z of what is kept of the model, mm: without its ears, its crown and its neck."""
_VIEWS = ((0, 0), (35, 0), (-35, 0), (0, 30), (0, -30))
"""(yaw, pitch), degrees, from where what is kept can be seen."""

Doubles = NDArray[np.float64]
Longs = NDArray[np.int64]


def main() -> int:
    """Write the basis and say how much of the model it holds."""
    parser = argparse.ArgumentParser(prog="python -m bench.prior_basis", description=__doc__)
    parser.add_argument("--output", type=Path, default=_TARGET)
    output = parser.parse_args().output
    shared = shared_folder()
    if shared is None or not (shared / "faces" / MODEL).is_file():
        print(f"{MODEL} is not at hand", file=sys.stderr)
        return 1
    with np.load(shared / "faces" / MODEL, allow_pickle=False) as data:
        mean, triangles = data["V0"].astype(np.float64), data["F"].astype(np.int64)
        modes = np.concatenate([data["modes"].astype(np.float64),
                                _EXPRESSION * data["expressions"].astype(np.float64)])
    vertices, triangles, modes = _simplified(mean, _visible(mean, triangles), modes)
    order = _spread(vertices)
    triangles = np.argsort(order)[triangles]
    vertices, modes = vertices[order], modes[:, order]
    _, lengths, components = np.linalg.svd(modes.reshape(len(modes), -1), full_matrices=False)
    kept = (lengths[:_MODES, None] * components[:_MODES]).reshape(_MODES, -1, 3)
    scales = np.abs(kept).max(axis=(1, 2)) / 127
    missing = np.sqrt((lengths[_MODES:] ** 2).sum() / len(vertices))
    np.savez_compressed(
        output, vertices=(vertices - vertices.mean(axis=0)).astype(np.float32),
        triangles=triangles.astype(np.uint16), scales=scales.astype(np.float32),
        modes=np.rint(kept / scales[:, None, None]).astype(np.int8),
        missing_mm=np.float32(missing / np.sqrt(3)))
    share = (lengths[:_MODES] ** 2).sum() / (lengths**2).sum()
    print(f"{output.name}: {len(vertices)} vertices, {len(triangles)} triangles, {_MODES} modes, "
          f"{output.stat().st_size / 1000:.0f} kB; {100 * share:.1f} % of the variance, "
          f"{missing:.2f} mm are left out")
    return 0


def _visible(vertices: Doubles, triangles: Longs) -> Longs:
    """Give the triangles that are in the window and seen from one of the views."""
    corners = vertices[triangles]
    middles = corners.mean(axis=1)
    inside = np.all([(low < middles[:, k]) & (middles[:, k] < high)
                     for k, (low, high) in enumerate(_WINDOW)], axis=0)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.zeros(len(triangles), bool)
    for yaw, pitch in np.radians(_VIEWS):
        toward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch),
                           -np.cos(yaw) * np.cos(pitch)])
        start = middles + 0.05 * toward
        rays = np.concatenate([start, np.broadcast_to(toward, start.shape)], axis=1)
        free = ~np.isfinite(scene.cast_rays(rays.astype(np.float32))["t_hit"].numpy())
        seen |= free & (normals @ toward > 0)
    return triangles[inside & seen]


def _simplified(
    vertices: Doubles, triangles: Longs, modes: Doubles
) -> tuple[Doubles, Longs, Doubles]:
    """Give a mesh of fewer triangles, without holes, and the modes on it."""
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices),
                                     o3d.utility.Vector3iVector(triangles.astype(np.int32)))
    labels, sizes, _ = (np.asarray(one) for one in mesh.cluster_connected_triangles())
    mesh.remove_triangles_by_mask(labels != sizes.argmax())
    mesh.remove_unreferenced_vertices()
    few = mesh.simplify_quadric_decimation(_TRIANGLES)
    few.remove_degenerate_triangles()
    few.remove_unreferenced_vertices()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    found = scene.compute_closest_points(np.asarray(few.vertices, np.float32))
    corners = triangles[found["primitive_ids"].numpy()]
    u, v = found["primitive_uvs"].numpy().T.astype(np.float64)
    parts = np.stack([1 - u - v, u, v], axis=1)
    at = np.einsum("nc,ncx->nx", parts, vertices[corners])
    moved = np.einsum("nc,kncx->knx", parts, modes[:, corners])
    return _closed(at, np.asarray(few.triangles, np.int64), moved)


def _closed(
    vertices: Doubles, triangles: Longs, modes: Doubles
) -> tuple[Doubles, Longs, Doubles]:
    """Close all holes but the outline, the longest, each by a fan about its mean."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    inner = {tuple(edge) for edge in edges}
    follows = {b: a for a, b in edges if (b, a) not in inner}
    loops = []
    while follows:
        first, at = follows.popitem()
        loop = [first]
        while at in follows:
            loop.append(at)
            at = follows.pop(at)
        loops.append(loop)
    loops.sort(key=len)
    for loop in loops[:-1]:
        middle = len(vertices)
        vertices = np.concatenate([vertices, vertices[loop].mean(axis=0)[None]])
        modes = np.concatenate([modes, modes[:, loop].mean(axis=1)[:, None]], axis=1)
        fan = [(a, b, middle) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
        triangles = np.concatenate([triangles, np.array(fan)])
    return vertices, triangles, modes


def _spread(points: Doubles) -> Longs:
    """Order points so that the first few, however many, lie far from each other."""
    order = [int(np.abs(points - points.mean(axis=0)).sum(axis=1).argmin())]
    away = np.full(len(points), np.inf)
    while len(order) < len(points):
        away = np.minimum(away, np.linalg.norm(points - points[order[-1]], axis=1))
        away[order[-1]] = -1
        order.append(int(away.argmax()))
    return np.array(order)


if __name__ == "__main__":
    sys.exit(main())
