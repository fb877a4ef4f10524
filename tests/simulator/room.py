"""What is behind the people: a wall, or a room with something in it."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulator.surface import Surface

__all__ = ["room", "wall"]


def wall(
    distance_mm: float, decor: int, color: tuple[int, int, int]
) -> list[Surface]:
    """Build one flat wall across the whole view, `distance_mm` along z."""
    half = 1.2 * distance_mm
    return [_panel((-half, -half, distance_mm), (2 * half, 0, 0), (0, 2 * half, 0),
                   _pattern(decor, color, 2 * half))]


def room(decor: int) -> list[Surface]:
    """Build a room: far wall askew, side wall, floor, ceiling, a cupboard and a desk."""
    w, top, floor = 2400.0, -1300.0, 1100.0
    left, right = (-w, 2750.0), (w, 3350.0)
    far = (right[0] - left[0], 0.0, right[1] - left[1])
    surfaces = [
        _panel((left[0], top, left[1]), far, (0, floor - top, 0),
               _pattern(decor, (188, 182, 170), 4800)),
        _panel((-1300, top, 300), (-500, 0, 3000), (0, floor - top, 0),
               _pattern(decor + 1, (150, 160, 170), 3000)),
        _panel((-w, floor, 400), (2 * w, 0, 0), (0, 0, 3400),
               _pattern(decor + 2, (120, 96, 76), 4800)),
        _panel((-w, top, 400), (2 * w, 0, 0), (0, 0, 3400),
               _pattern(decor + 3, (214, 212, 206), 4800)),
    ]
    surfaces += _box((520, -500, 2050), (1150, floor, 2600), decor + 4, (134, 104, 78))
    surfaces += _box((-1000, 420, 1650), (-250, floor, 2300), decor + 5, (98, 108, 96))
    return surfaces


def _box(low: tuple[float, float, float], high: tuple[float, float, float], decor: int,
         color: tuple[int, int, int]) -> list[Surface]:
    """Build the three sides of a box that a camera before it can see, and the far ones."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
    texture = _pattern(decor, color, max(dx, dy, dz))
    return [
        _panel((x0, y0, z0), (dx, 0, 0), (0, dy, 0), texture),
        _panel((x0, y0, z0), (0, 0, dz), (0, dy, 0), texture),
        _panel((x1, y0, z0), (0, 0, dz), (0, dy, 0), texture),
        _panel((x0, y0, z0), (dx, 0, 0), (0, 0, dz), texture),
    ]


def _panel(corner: tuple[float, float, float], across: tuple[float, float, float],
           down: tuple[float, float, float], texture: NDArray[np.uint8]) -> Surface:
    a, u, v = (np.array(value, np.float64) for value in (corner, across, down))
    vertices = np.stack([a, a + u, a + v, a + u + v]).astype(np.float32)
    faces = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    place = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], np.float32)
    return Surface(vertices=vertices, faces=faces, colors=np.zeros((4, 3), np.uint8),
                   uv=place[faces], texture=texture)


@lru_cache(maxsize=32)
def _pattern(seed: int, color: tuple[int, int, int], size_mm: float) -> NDArray[np.uint8]:
    """Paint a wall: blotches, grain and a few framed rectangles, all of moderate contrast."""
    rng = np.random.default_rng(1000 + seed)
    side = 1024
    image = np.empty((side, side, 3))
    image[:] = color
    for cells, strength in ((12, 8.0), (60, 5.0), (360, 4.0)):
        noise = cv2.resize(rng.normal(size=(cells, cells)), (side, side),
                           interpolation=cv2.INTER_CUBIC)
        image += (strength * noise)[..., None]
    scale = side / size_mm
    for _ in range(7):
        x, y = rng.integers(0, side, 2)
        w, h = (rng.uniform(250, 700, 2) * scale).astype(int)
        tone = np.array(color) * rng.uniform(0.45, 1.1) + rng.uniform(-15, 15, 3)
        image[y:y + h, x:x + w] = 0.3 * image[y:y + h, x:x + w] + 0.7 * tone
        cv2.rectangle(image, (int(x), int(y)), (int(x + w), int(y + h)),
                      tuple(0.6 * tone), max(1, int(15 * scale)))
    return np.clip(image, 0, 255).astype(np.uint8)
