"""Lambertian shading of normals: shape without colour, so that terraces and dents show."""

import numpy as np
from numpy.typing import NDArray

_KEY_LIGHT = np.array([-0.55, -0.55, -0.63])
"""Direction to the main light, camera frame: upper left, grazing, for relief."""
_FILL_LIGHT = np.array([0.70, 0.10, -0.70])
"""Direction to the weak light that fills the shadows, camera frame."""
_AMBIENT, _KEY, _FILL = 0.06, 0.82, 0.20
"""Parts of white: light from everywhere, and of each light on a surface that faces it."""
_GAMMA = 1.4
"""Brightens the darker half of the shading."""
_CLAY = np.array([214, 206, 196])
"""Colour of the surface where fully lit, RGB."""


def shade(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Light a matt surface from the upper left, weakly from the right.

    Parameters
    ----------
    normals : (n, 3) float, unit length, toward the camera, camera frame

    Returns
    -------
    (n, 3) uint8, RGB
    """
    key = np.clip(normals @ (_KEY_LIGHT / np.linalg.norm(_KEY_LIGHT)), 0, None)
    fill = np.clip(normals @ (_FILL_LIGHT / np.linalg.norm(_FILL_LIGHT)), 0, None)
    light = np.clip(_AMBIENT + _KEY * key + _FILL * fill, 0, 1)
    return np.asarray(np.round(light[:, None] ** (1 / _GAMMA) * _CLAY), np.uint8)
