"""How far what a box shows bulges toward the camera."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.detection._relief_kernels import fitted_bulge

__all__ = ["bulge_mm"]


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
    bulge, known = fitted_bulge(depths, depth_mm)
    return float(bulge) if known else np.inf
