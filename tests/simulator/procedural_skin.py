"""The procedural head's paint: skin, eyes, brows, lips and hair."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["paint"]

Array = NDArray[np.float64]

_SKIN = (212, 168, 146)
_BLUSH = (206, 140, 124)
_LIPS = (172, 94, 92)
_HAIR = (58, 42, 34)
_BROW = (74, 54, 44)
_WHITE = (226, 220, 214)
_IRIS = (84, 66, 50)
_DARK = (24, 18, 16)


def paint(points: Array) -> NDArray[np.uint8]:
    """Paint a texture.

    Parameters
    ----------
    points : (h, w, 3) float64, mm, the procedural head's coordinates: where each texel lies

    Returns
    -------
    (h, w, 3) uint8, RGB (sRGB)
    """
    x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
    front = z < 60
    image = np.empty(points.shape)
    image[:] = _SKIN
    rng = np.random.default_rng(7)
    mottle = _noise(rng, x.shape, 6) + 0.6 * _noise(rng, x.shape, 1.5)
    image += 3.0 * mottle[..., None]

    _mix(image, _BLUSH, 0.7 * _blob(x, y, 42, 40, 17, 13) * front)
    _mix(image, (182, 134, 118), 0.55 * _blob(x, y, 28, 4, 19, 11) * front)     # round the eyes
    _mix(image, (150, 104, 90), 0.5 * _blob(x, y, 16.5, 45, 3, 4) * front)      # behind the wings
    _mix(image, (168, 122, 106), 0.5 * _blob(x, y, 0, 86, 14, 3.5) * front)
    _mix(image, _LIPS, front * _soft(1 - (x / 25) ** 2 - ((y - 71) / (9 - 0.12 * x)) ** 2, 0.15))
    _mix(image, (92, 40, 42), front * _soft(1 - (x / 24) ** 2 - ((y - 70.6) / 1.2) ** 2, 0.3))
    _mix(image, _DARK, front * _soft(1 - ((x - 7) / 4.5) ** 2 - ((y - 48.5) / 2.2) ** 2, 0.3))

    arch = -17 - 5 * np.exp(-0.5 * ((x - 38) / 12) ** 2) + 0.004 * (x - 32) ** 2
    brow = _soft(1 - ((x - 33) / 20) ** 2 - ((y - arch) / 3.6) ** 2, 0.25)
    _mix(image, _BROW, 0.92 * brow * front)
    lid = 1 - ((x - 32) / 14.5) ** 2 - ((y - 2) / 5.6) ** 2
    eye = _soft(lid, 0.1) * front
    _mix(image, _DARK, 0.8 * front * _soft(0.35 - np.abs(lid - 0.02), 0.1) * (y < 4))
    _mix(image, _WHITE, eye)
    away = np.hypot(x - 32, y - 1.6)
    _mix(image, _IRIS, eye * _soft(6.2 - away, 0.5))
    _mix(image, _DARK, eye * _soft(3.0 - away, 0.5))

    # Hair: above the hairline, behind the temples, down to the nape.
    line = -66 + 0.010 * x**2 + np.where(z > 20, 1.0 * (z - 20), 0)
    hair = _soft(line - y, 3.0) * (y < 60)
    hair = np.maximum(hair, (z > 98) * (y < 105) * 1.0)
    streaks = 1 + 0.25 * cv2.GaussianBlur(rng.normal(size=x.shape), (0, 0), 1.0, sigmaY=12) * 4
    _mix(image, np.clip(np.array(_HAIR) * streaks[..., None], 15, 120), hair)
    return np.clip(image, 0, 255).astype(np.uint8)


def _mix(image: Array, color: tuple[int, int, int] | Array, share: Array) -> None:
    image += share[..., None] * (np.asarray(color, np.float64) - image)


def _blob(x: Array, y: Array, cx: float, cy: float, wx: float, wy: float) -> Array:
    return np.exp(-0.5 * (((x - cx) / wx) ** 2 + ((y - cy) / wy) ** 2))


def _soft(inside: Array, width: float) -> Array:
    """Give 1 where positive, 0 where negative, with a soft edge."""
    return np.clip(inside / width + 0.5, 0, 1)


def _noise(rng: np.random.Generator, shape: tuple[int, ...], sigma: float) -> Array:
    field = cv2.GaussianBlur(rng.normal(size=shape), (0, 0), sigma)
    return np.asarray(field / field.std(), np.float64)
