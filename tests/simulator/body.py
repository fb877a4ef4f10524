"""What a head needs around it: clothed shoulders, glasses, a hand."""

import numpy as np
from numpy.typing import NDArray

from tests.simulator.landmarks import Landmarks
from tests.simulator.surface import Surface

__all__ = ["glasses", "hand", "torso"]

Array = NDArray[np.float64]

# Below the neck, mm: y, half width, half depth, how far back the middle lies.
_TORSO = np.array([
    (-14, 0.0, 0.0, 0), (-13, -4.0, -4.0, 0), (-2, 7, 7, 0), (14, 32, 16, 4), (32, 78, 28, 8),
    (48, 122, 40, 12), (66, 146, 50, 14), (95, 156, 58, 14), (160, 158, 64, 10), (420, 150, 62, 0),
], np.float64)


def torso(neck: tuple[float, float, float, float]) -> Surface:
    """Build clothed shoulders and chest below a neck (half width, y, z, half depth), mm."""
    half, top, middle, depth = neck
    y = np.concatenate([_TORSO[:1, 0], np.linspace(-13, 80, 60), np.linspace(84, 420, 40)])
    wide, deep, back = (np.interp(y, _TORSO[:, 0], _TORSO[:, k]) for k in (1, 2, 3))
    wide, deep = wide + half, deep + depth
    wide[0] = deep[0] = 0.0
    turn = np.linspace(0, 2 * np.pi, 121)
    s, c = np.sin(turn), np.cos(turn)
    power = 2 / 2.4
    x = wide[:, None] * np.sign(s) * np.abs(s) ** power
    z = middle + back[:, None] + deep[:, None] * np.sign(c) * np.abs(c) ** power
    # Folds, so that cloth is not smoother than skin.
    folds = 1.5 * np.sin(y[:, None] / 17 + 2 * np.sin(turn)) * np.sin(turn * 9) * (y[:, None] > 20)
    points = np.stack([x, np.broadcast_to(y[:, None] + top, x.shape), z + folds], -1)
    stripe = 0.85 + 0.15 * np.sign(np.sin(y / 6.0))
    colors = np.clip(np.array([62, 78, 112]) * stripe[:, None, None], 0, 255)
    return _loft(points, np.broadcast_to(colors, points.shape))


def glasses(marks: Landmarks) -> Surface:
    """Build a pair of dark frames with temples, head frame, mm."""
    ex, ey, ez = marks.eyes
    front = ez - 14
    rims = []
    for side in (-1, 1):
        turn = np.linspace(0, 2 * np.pi, 49)
        ring = np.stack([side * ex + 23 * np.cos(turn), ey + 2 + 17 * np.sin(turn),
                         front + 0.004 * (side * ex + 23 * np.cos(turn)) ** 2], -1)
        rims.append(_tube(ring, 2.2))
        start = np.array([side * (ex + 23), ey, front + 0.004 * (ex + 23) ** 2])
        end = np.array([side * 80.0, marks.ear_top[0] - 2, marks.ear_top[1] + 20])
        rims.append(_tube(start + np.linspace(0, 1, 20)[:, None] * (end - start), 1.8))
    bridge = np.stack([np.linspace(23 - ex, ex - 23, 9), np.full(9, ey - 3),
                       np.full(9, front - 1)], -1)
    return _join([*rims, _tube(bridge, 2.0)], (28, 26, 30))


def hand(marks: Landmarks, color: tuple[int, int, int] = (205, 160, 140)) -> Surface:
    """Build a hand held before one cheek and the chin, head frame, mm."""
    y, z = marks.mouth[0] + 22, marks.nose_tip[1] - 12
    palm = np.array([52.0, y + 42, z])
    fingers = [_tube(palm + np.array([dx, -10, 0]) + np.linspace(0, 1, 12)[:, None]
                     * np.array([lean, -reach, 0]), 8.5)
               for dx, lean, reach in ((-26, -22, 60), (-9, -8, 74), (9, 6, 70), (26, 18, 56))]
    fingers.append(_tube(palm + np.linspace(0, 1, 12)[:, None] * np.array([-58, -6, 2]), 10))
    fingers.append(_tube(palm + np.array([0, -6, 6]) + np.linspace(0, 1, 20)[:, None]
                         * np.array([8, 190, 40]), 30))
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 33), np.linspace(0, np.pi, 17))
    ball = palm + np.stack([40 * np.sin(v) * np.cos(u), 42 * np.cos(v),
                            13 * np.sin(v) * np.sin(u)], -1)
    return _join([*fingers, _loft(ball, np.zeros(ball.shape))], color)


def _tube(path: Array, radius: float) -> Surface:
    """Build a round tube along an open path, (n, 3) mm, with closed ends."""
    path = np.asarray(path, np.float64)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.cross(along, [0.31, 0.12, 0.94])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(along, aside)
    turn = np.linspace(0, 2 * np.pi, 17)
    ring = radius * (aside[:, None] * np.cos(turn)[:, None] + up[:, None] * np.sin(turn)[:, None])
    caps = [path[0] + shrink * ring[0] - along[0] * lift * radius
            for shrink, lift in ((0, 1), (0.7, 0.7))]
    ends = [path[-1] + shrink * ring[-1] + along[-1] * lift * radius
            for shrink, lift in ((0.7, 0.7), (0, 1))]
    points = np.concatenate([caps, path[:, None] + ring, ends])
    return _loft(points, np.zeros(points.shape))


def _loft(points: Array, colors: Array) -> Surface:
    """Span triangles over a (rows, columns, 3) grid of points."""
    index = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                            np.stack([b, d, c], -1).reshape(-1, 3)])
    return Surface(
        vertices=points.reshape(-1, 3).astype(np.float32), faces=faces.astype(np.int32),
        colors=colors.reshape(-1, 3).astype(np.uint8),
    )


def _join(surfaces: list[Surface], color: tuple[int, int, int]) -> Surface:
    counts = np.cumsum([0, *(len(one.vertices) for one in surfaces)])
    return Surface(
        vertices=np.concatenate([one.vertices for one in surfaces]),
        faces=np.concatenate([one.faces + start for one, start in
                              zip(surfaces, counts[:-1], strict=True)]).astype(np.int32),
        colors=np.broadcast_to(np.array(color, np.uint8), (int(counts[-1]), 3)),
    )
