"""Light on normals: shape without colour, so that terraces and dents are seen."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["shade"]

_KEY = np.array([-0.55, -0.55, -0.63])
"""Towards the light, camera frame: from the upper left, grazing, for relief."""
_FILL = np.array([0.70, 0.10, -0.70])
_CLAY = np.array([214, 206, 196])


def shade(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Light a matt surface from the upper left, with a weak light from the right.

    Parameters
    ----------
    normals : (n, 3) float, unit length, toward the camera, camera frame

    Returns
    -------
    (n, 3) uint8, RGB
    """
    key = np.clip(normals @ (_KEY / np.linalg.norm(_KEY)), 0, None)
    fill = np.clip(normals @ (_FILL / np.linalg.norm(_FILL)), 0, None)
    light = np.clip(0.06 + 0.82 * key + 0.20 * fill, 0, 1)
    shaded: NDArray[np.uint8] = np.round(light[:, None] ** (1 / 1.4) * _CLAY).astype(np.uint8)
    return shaded
