"""Hair with a shape of its own: a cap with a fringe and locks at the temples, and a beard."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tests.simulator.landmarks import Landmarks
from tests.simulator.surface import Surface

__all__ = ["beard", "hair"]

Array = NDArray[np.float64]

_COLOR = (44, 34, 28)
_EDGE_MM = 4.0
"""Longest edge of its triangles."""
_CAP_MM, _BEARD_MM, _RISE_MM = 16.0, 9.0, 10.0
"""How far each stands off the skin, and within what distance of its edge it rises."""
_STRAND_MM = 1.6
"""How uneven it is, standard deviation, mm."""


def hair(head: Surface, marks: Landmarks) -> Surface:
    """Grow hair on a head, head frame, mm: above the hairline, around the ears, locks over both."""
    x, y, z = head.vertices.astype(np.float64).T
    ear = min(marks.ear_top[1], marks.ear_bottom[1])
    slope = (marks.ear_top[0] - marks.hairline[0]) / (ear - marks.hairline[1])
    top = marks.hairline[0] - 4 + slope * np.maximum(z - marks.hairline[1], 0)
    inside = np.maximum(top - y, np.minimum(z - ear - 18, marks.ear_bottom[0] + 10 - y))
    # Uneven as a hairline is.
    inside += 3 * np.sin(y / 5 + 1) + 3 * np.sin(x / 7)
    return _joined([_grown(head, inside, _CAP_MM), *_locks(head, marks)])


def beard(head: Surface, marks: Landmarks) -> Surface:
    """Grow a beard, head frame, mm: from beneath the mouth over chin and jaw to the throat."""
    x, y, z = head.vertices.astype(np.float64).T
    ear = min(marks.ear_top[1], marks.ear_bottom[1])
    across = np.abs(x)
    above = np.maximum(marks.mouth[0] + 16 - 0.5 * np.maximum(across - 22, 0), marks.mouth[0] - 25)
    inside = np.minimum(np.minimum(y - above, ear - 12 - z), marks.chin[0] + 28 - y)
    return _grown(head, inside + 2 * np.sin(x / 5), _BEARD_MM)


def _grown(head: Surface, inside: Array, thick: float) -> Surface:
    """Raise the part of a surface that is inside, (n,) mm from its edge, off the rest."""
    kept = (inside[head.faces] > -6).any(axis=1)
    values = np.column_stack([head.vertices, head.normals, inside]).astype(np.float64)
    values, faces = _subdivided(values, head.faces[kept])
    points, normals, inside = values[:, :3], values[:, 3:6], values[:, 6]
    height = thick * np.clip(inside / _RISE_MM, -0.3, 1)
    waves = (np.sin(points @ (1.1, 0.25, 0.6)) + np.sin(points @ (0.5, -0.2, 1.3) + 2)
             + np.sin(points @ (-0.8, 0.4, 0.9) + 4))
    height += _STRAND_MM * waves * np.sqrt(2 / 3) * (inside > 2)
    return _colored(points + height[:, None] * normals, faces)


def _subdivided(values: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
    """Halve all edges until the longest is short: (n, k), position first, and (m, 3)."""
    used, renamed = np.unique(faces, return_inverse=True)
    values, faces = values[used], renamed.reshape(-1, 3).astype(np.int32)
    while True:
        pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, which = np.unique(pairs, axis=0, return_inverse=True)
        lengths = np.linalg.norm(values[edges[:, 0], :3] - values[edges[:, 1], :3], axis=1)
        if np.median(lengths) < _EDGE_MM / 2 or len(faces) > 200_000:
            return values, faces
        ab, bc, ca = (which.reshape(-1, 3) + len(values)).T.astype(np.int32)
        a, b, c = faces.T
        values = np.concatenate([values, (values[edges[:, 0]] + values[edges[:, 1]]) / 2])
        quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = np.concatenate([np.stack(corners, axis=1) for corners in quarters]).astype(np.int32)


def _locks(head: Surface, marks: Landmarks) -> list[Surface]:
    """Strands over the forehead and before the ears."""
    front = head.vertices[head.normals[:, 2] < -0.2].astype(np.float64)
    side = head.vertices[np.abs(head.normals[:, 0]) > 0.3].astype(np.float64)
    over_front, over_side = cKDTree(front[:, :2]), cKDTree(np.abs(side))
    found = []
    for start, lean, long in ((-42, 4, 42), (-30, 6, 30), (-17, -3, 24), (14, 5, 34), (33, -4, 26),
                              (46, 3, 46)):
        y = np.linspace(marks.hairline[0] - 24, marks.hairline[0] - 14 + long, 24)
        x = start + lean * np.linspace(0, 1, 24) ** 2
        z = front[over_front.query(np.column_stack([x, y]), k=5)[1], 2].mean(axis=1)
        found.append(_strand(np.column_stack([x, y, z - 5]), 3.2))
    for sign in (-1, 1):
        for back, long in ((-26, 40), (-17, 62), (-8, 88)):
            y = np.linspace(marks.ear_top[0] - 30, marks.ear_top[0] - 30 + long, 24)
            z = np.full(24, marks.ear_top[1] + back) + 2 * np.sin(y / 9)
            wide = np.abs(side[:, 0]).max()
            nearest = over_side.query(np.column_stack([np.full(24, wide), y, z]), k=5)[1]
            x = np.abs(side[nearest, 0]).mean(axis=1) + 3
            found.append(_strand(np.column_stack([sign * x, y, z]), 2.8))
    return found


def _strand(path: Array, radius: float) -> Surface:
    """A round tube along a path, (n, 3) mm, that ends in a point."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.cross(along, (0.31, 0.12, 0.94))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(along, aside)
    turn = np.linspace(0, 2 * np.pi, 9)[:-1]
    thin = radius * np.sqrt(np.linspace(1, 0.05, len(path)))[:, None, None]
    ring = path[:, None] + thin * (aside[:, None] * np.cos(turn)[:, None]
                                   + up[:, None] * np.sin(turn)[:, None])
    index = np.arange(len(path) * 8).reshape(-1, 8)
    a, b = index[:-1], index[1:]
    c, d = (np.roll(corner, -1, axis=1) for corner in (a, b))
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                            np.stack([b, d, c], -1).reshape(-1, 3)])
    return _colored(ring.reshape(-1, 3), faces)


def _colored(points: Array, faces: NDArray[np.integer]) -> Surface:
    streaks = 0.8 + 0.2 * np.sin(2 * points[:, 0] + 0.3 * points[:, 1])
    return Surface(vertices=points.astype(np.float32), faces=faces.astype(np.int32),
                   colors=(streaks[:, None] * _COLOR).astype(np.uint8))


def _joined(surfaces: list[Surface]) -> Surface:
    starts = np.cumsum([0, *(len(one.vertices) for one in surfaces[:-1])])
    return Surface(
        vertices=np.concatenate([one.vertices for one in surfaces]),
        faces=np.concatenate([one.faces + np.int32(start)
                              for one, start in zip(surfaces, starts, strict=True)]),
        colors=np.concatenate([one.colors for one in surfaces]))
