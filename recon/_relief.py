"""How far what a box shows bulges toward the camera."""

import numpy as np
from numpy.typing import NDArray

from recon._detect_kernels import bulge_terms

__all__ = ["bulge_mm"]

# What is this much nearer or farther than the middle is not part of the same head.
_HEAD_MM = 120.0
# Fewer depths do not tell a bulge from noise.
_LEAST_DEPTHS = 12
_BEFORE_MM = 20.0
_FITS = 3


def bulge_mm(depths: NDArray[np.float64], depth_mm: float) -> float:
    """Fit z = a + b u + c v + d (u^2 + v^2) to a box's depths, and give d at the box's sides.

    A wall, a cupboard or a photograph, however slanted, has none; a face about 30 mm.

    Parameters
    ----------
    depths : (n, 3), u and v from -1 to 1 in the box, and z, mm
    depth_mm : median z in the middle of the box

    Returns
    -------
    mm, positive where the middle is nearer than the sides; inf where depths are too few to tell
    """
    kept = np.ones(len(depths), np.bool_)
    fitted: NDArray[np.float64] = np.zeros(4)
    best, last = -np.inf, 0
    # A hand before the chin takes the bulge away: what is so far before all else is left out.
    for fit in range(_FITS):
        before = _BEFORE_MM if fit else _HEAD_MM  # nothing is fitted yet
        matrix, right, count = bulge_terms(depths, depth_mm, _HEAD_MM, fitted, before, kept)
        if count < _LEAST_DEPTHS or count == last:
            break
        fitted = np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], np.float64)
        best, last = max(best, float(fitted[3])), count
    return best if last else np.inf
