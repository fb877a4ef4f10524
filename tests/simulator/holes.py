"""Where a face gives no depth: eyes, nostrils, hair, brows, shiny skin."""

import numpy as np
from numpy.typing import NDArray

from tests.simulator.camera_views import DepthView
from tests.simulator.labels import Label
from tests.simulator.landmarks import Landmarks

__all__ = ["hole_share"]

_DARK = 0.035
"""Linear albedo below which little of the pattern comes back."""
_HAIR, _BEARD = 0.6, 0.3
"""How likely a sample of hair has no depth, and one of a beard, which is shorter."""
_NECK, _THROAT_MM = 0.85, 4.0
"""The same of a neck in the shade of a chin, but for a strip of so many mm half width."""


def hole_share(
    view: DepthView, marks: Landmarks | None, level: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Give how likely each sample of a view has no depth, (H, W) float32, 0-1.

    Parameters
    ----------
    view : the true view
    marks : the target head's landmarks, head frame; None where there is nobody
    level : `Scene.holes`
    rng : draws the patches; the same in each frame of a still scene
    """
    share = np.zeros(view.depth.shape, np.float32)
    centres = rng.uniform(-1, 1, (5, 2))
    if marks is None or level <= 0:
        return share
    rows, columns = np.nonzero(np.isfinite(view.on_head[..., 0]))
    x, y, z = view.on_head[rows, columns].T
    face = view.labels[rows, columns] == Label.FACE
    side, front = np.abs(x), z < marks.eyes[2] + 15
    on = np.zeros(len(x))

    def spot(cx: float, cy: float, rx: float, ry: float, strength: float,
             across: NDArray[np.floating] = side) -> None:
        reach = np.hypot((across - cx) / rx, (y - cy) / ry)
        np.maximum(on, strength * np.clip(1.6 - reach, 0, 1) * front, out=on)

    ex, ey, _ = marks.eyes
    grow = 0.6 + 0.8 * level
    spot(ex, ey, 7 * grow, 4.5 * grow, min(1.0, 1.6 * level))
    spot(7, marks.nose_tip[0] + 7, 5 * grow, 4 * grow, min(1.0, 2.0 * level))
    dark = np.clip(1 - view.albedo[rows, columns] / _DARK, 0, 1)
    np.maximum(on, level * dark, out=on)
    if level > 0.5:
        spot(ex, ey - 19, 16, 3.5, 1.4 * (level - 0.3))
        spot(0, marks.mouth[0], 12, 3, 1.2 * (level - 0.3))
        places = ((-42, ey + 34), (42, ey + 34), (-20, marks.hairline[0] + 25),
                  (22, marks.hairline[0] + 28), (0, marks.chin[0] - 14))
        for (cx, cy), (dx, dy) in zip(places, centres, strict=True):
            spot(cx + 8 * dx, cy + 6 * dy, 9 * level, 7 * level, level, across=x)
        painted = ~face & (y < marks.hairline[0] + 5)
        np.maximum(on, 0.6 * level * painted, out=on)
    hair = view.hair[rows, columns]
    if hair.any():
        on[(y > marks.chin[0] + 4) & (side > _THROAT_MM)] = _NECK
        on[hair] = np.where(y[hair] > marks.nose_tip[0] + 12, _BEARD, _HAIR)
    share[rows, columns] = on
    return share
