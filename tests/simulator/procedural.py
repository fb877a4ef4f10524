"""A head made by code alone, so that the project needs nobody's data to test itself.

A stack of superellipses with bumps for the features; the texture is painted in millimetres.
Coordinates: x right, y down, z forward, mm; y = 0 on the line of the eyes, z = 0 a little behind
the bridge of the nose, the face looking toward -z.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from tests.simulator.landmarks import Landmarks
from tests.simulator.procedural_skin import paint
from tests.simulator.surface import Surface

__all__ = ["LANDMARKS", "build"]

Array = NDArray[np.float64]

LANDMARKS = Landmarks(
    bridge=(0, -5), hairline=(-66, 6), chin=(113, 8), ear_top=(-8, 68), ear_bottom=(44, 68),
    eyes=(32, 2, 6), nose_tip=(40, -27), mouth=(71, -5), neck=(60, 165, 95, 52),
)

_ROWS, _COLUMNS = 420, 480
_TEXTURE = (1024, 1024)

# y, half width, z of the front, z of the widest place, z of the back; mm.
_PROFILE = np.array([
    (-110, 0.1, 78, 80, 82),
    (-107, 24, 50, 85, 112),
    (-100, 41, 29, 86, 138),
    (-85, 57, 13, 86, 160),
    (-60, 69, 4, 86, 177),
    (-35, 74, 0, 87, 184),
    (-10, 76, 2, 88, 184),
    (15, 75, 5, 88, 176),
    (40, 72, 5, 86, 163),
    (65, 67, 4, 82, 152),
    (85, 60, 4, 78, 147),
    (100, 53, 6, 78, 146),
    (110, 48, 10, 84, 146),
    (116, 47, 24, 90, 146),
    (122, 50, 42, 92, 146),
    (135, 54, 50, 94, 147),
    (160, 57, 46, 96, 150),
    (200, 62, 42, 98, 156),
], np.float64)

# x, y, width, height (standard deviations), height of the bump toward the viewer; mm.
_BUMPS = (
    (24, -17, 17, 6, 4.0),      # brow
    (31, 3, 13, 9, -8.0),       # eye socket
    (32, 2, 9, 6, 5.0),         # eyeball under the lids
    (46, 32, 15, 12, 4.0),      # cheekbone
    (13.5, 40, 5, 5.5, 8.0),    # wing of the nose
    (10, 65.5, 11, 3.2, 4.5),   # upper lip
    (8, 76, 12, 3.6, 5.0),      # lower lip
    (8, 70.8, 14, 1.3, -2.2),   # line of the mouth
    (6, 86, 14, 4, -3.5),       # under the lower lip
    (7, 101, 13, 9, 6.0),       # chin
    (24, 58, 7, 10, -2.0),      # beside the mouth
)


def build() -> Surface:
    """Build the head, its neck and its ears."""
    # Rows are closest where the crown and the chin turn away from the viewer.
    rows = np.linspace(0, 1, _ROWS)
    y = np.interp(rows, [0, 0.06, 0.6, 0.75, 1], [-110, -106.5, 95, 128, 200])
    turn = np.linspace(-np.pi, np.pi, _COLUMNS)
    vertices = _skull(y[:, None], turn[None, :])
    index = np.arange(_ROWS * _COLUMNS).reshape(_ROWS, _COLUMNS)
    a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                            np.stack([b, d, c], -1).reshape(-1, 3)])
    uv = np.stack(np.broadcast_arrays(np.linspace(0, 1, _COLUMNS)[None, :], rows[:, None]), -1)
    uv_corners = uv.reshape(-1, 2)[faces]

    texture_rows = (np.arange(_TEXTURE[0]) + 0.5) / _TEXTURE[0]
    texture_y = np.interp(texture_rows, rows, y)
    texture_turn = ((np.arange(_TEXTURE[1]) + 0.5) / _TEXTURE[1] * 2 - 1) * np.pi
    texture = paint(_skull(texture_y[:, None], texture_turn[None, :]))

    ears = [_ear(side) for side in (-1, 1)]
    count, total = len(ears[0][0]), _ROWS * _COLUMNS
    ear_faces = np.concatenate([ears[k][1] + total + k * count for k in range(2)])
    spot = np.array([0.30, np.interp(45, y, rows)])  # plain skin of the cheek
    return Surface(
        vertices=np.concatenate([vertices.reshape(-1, 3), ears[0][0], ears[1][0]])
        .astype(np.float32),
        faces=np.concatenate([faces, ear_faces]).astype(np.int32),
        colors=np.zeros((total + 2 * count, 3), np.uint8),
        uv=np.concatenate([uv_corners, np.broadcast_to(spot, (len(ear_faces), 3, 2))])
        .astype(np.float32),
        texture=texture,
    )


def _skull(y: Array, turn: Array) -> Array:
    """Give the point at a height and a turn about the vertical, 0 the front: (..., 3) mm."""
    half, front, middle, back = (
        PchipInterpolator(_PROFILE[:, 0], _PROFILE[:, k])(y) for k in (1, 2, 3, 4)
    )
    s, c = np.sin(turn), np.cos(turn)
    # Faces are squarer in front than an ellipse, skulls are not.
    power = np.where(c > 0, 2 / 2.25, 1.0)
    x = half * np.sign(s) * np.abs(s) ** power
    z = middle - np.where(c > 0, middle - front, back - middle) * np.sign(c) * np.abs(c) ** power
    x, y = np.broadcast_arrays(x, y)
    fade = np.clip((c - 0.15) / 0.35, 0, 1) ** 2
    return np.stack([x, y, z - fade * _features(x, y)], axis=-1)


def _features(x: Array, y: Array) -> Array:
    """Give how far the features stand out of the smooth head, mm."""
    side = np.abs(x)
    height = np.zeros(x.shape)
    for bx, by, wx, wy, bump in _BUMPS:
        height += bump * np.exp(-0.5 * (((side - bx) / wx) ** 2 + ((y - by) / wy) ** 2))
    ridge = PchipInterpolator([-40, -14, -2, 15, 34, 41, 46, 51, 70],
                              [0, 0, 5, 13, 22, 24, 18, 3, 0], extrapolate=False)(y)
    width = np.interp(y, [-14, 10, 34, 48], [8, 6, 8.5, 9])
    height += np.nan_to_num(ridge) * np.exp(-0.5 * (side / width) ** 2)
    return height


def _ear(side: int) -> tuple[Array, NDArray[np.int64]]:
    """Build one ear: a flat ellipsoid that stands off at the back."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(0, np.pi, 19))
    ball = np.stack([6 * np.sin(v) * np.cos(u), 30 * np.cos(v), 17 * np.sin(v) * np.sin(u)], -1)
    ball[..., 0] = side * (ball[..., 0] + 0.45 * ball[..., 2])
    points = ball.reshape(-1, 3) + np.array([side * 78.0, 18.0, 88.0])
    index = np.arange(len(points)).reshape(u.shape)
    a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                            np.stack([b, d, c], -1).reshape(-1, 3)])
    return points, faces
