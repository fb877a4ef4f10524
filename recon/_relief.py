"""How far what a box shows bulges toward the camera."""

import numpy as np
from numpy.typing import NDArray

from recon.face import Box
from recon.registration import Registration

__all__ = ["bulge_mm"]

# What is this much nearer or farther than the middle is not part of the same head.
_HEAD_MM = 120.0
# Fewer depths do not tell a bulge from noise.
_LEAST_DEPTHS = 12
_BEFORE_MM = 20.0
_FITS = 3


def bulge_mm(registered: Registration, box: Box, depth_mm: float) -> float:
    """Fit z = a + b u + c v + d (u^2 + v^2) to a box's depths, and give d at the box's sides.

    A wall, a cupboard or a photograph, however slanted, has none; a face about 30 mm.

    Parameters
    ----------
    registered : the depth tied to the colour image
    box : x, y, width, height; pixels of the colour image
    depth_mm : median z in the middle of the box

    Returns
    -------
    mm, positive where the middle is nearer than the sides; inf where depths are too few to tell
    """
    x, y, w, h = box
    half = np.float32(w / 2)
    u = (registered.pixels[..., 0] - np.float32(x + w / 2)) / half
    v = (registered.pixels[..., 1] - np.float32(y + h / 2)) / half
    z = registered.color_depth
    inside = registered.visible & (u * u + v * v < 1) & (np.abs(z - depth_mm) < _HEAD_MM)
    if np.count_nonzero(inside) < _LEAST_DEPTHS:
        return np.inf
    u, v, z = (one[inside].astype(np.float64) for one in (u, v, z - np.float32(depth_mm)))
    terms = np.stack([np.ones_like(u), u, v, u * u + v * v])
    best = -np.inf
    # A hand before the chin takes the bulge away: what is so far before all else is left out.
    for _ in range(_FITS):
        fitted = _fitted(terms, z)
        best = max(best, float(fitted[3]))
        behind = z - fitted @ terms > -_BEFORE_MM
        if behind.all() or np.count_nonzero(behind) < _LEAST_DEPTHS:
            break
        terms, z = terms[:, behind], z[behind]
    return best


def _fitted(terms: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    found, *_ = np.linalg.lstsq(terms @ terms.T, terms @ z, rcond=None)
    return np.asarray(found)
