"""Where the fit bridges a step that nothing was read of: no points, but inside a face.

Between ear and cheek such a bridge ends at the outline. One that is enclosed is a side that the
camera sees too steeply, of a nose or a jaw: there the surface goes on (docs/decisions/0046).
"""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Doubles
from denseface.recon.intermediate import SurfaceGrid
from denseface.recon.numerics.morphology import enclosed_parts

_STEEP = 4.0
"""Slope from which on a fit without seeds bridges a step (docs/decisions/0018)."""
_UNREAD = 0.7
"""Farther than this from every seed nothing was read, mean spacings."""
_SPECK_PX = 2
"""Bridges narrower than this stay, points of the support's grid."""
_MAX_STEP_MM = 40.0
"""An enclosed bridge over more depth joins two surfaces. No nose stands out so far."""
_STEEPEST = 14.0
"""And one that is steeper anywhere: 86 degrees."""


def without_bridges(
    surface: SurfaceGrid, axes: tuple[Doubles, Doubles], spacing: float
) -> Bools:
    """Say where points are wanted: on the support without bridges, but for those that close a hole.

    Parameters
    ----------
    surface : the fit, with its support
    axes : x of the columns and y of the rows at which it is asked, mm
    spacing : mean spacing of the seeds, mm

    Gives (rows, columns).
    """
    support = surface.support
    _, dz_dx, dz_dy = surface.values
    slope2 = dz_dx * dz_dx + dz_dy * dz_dy
    bridge = slope2 > np.float32(_STEEP**2)
    if not bridge.any():
        return support.sampled(*axes)
    bridge &= support.near_seeds(_UNREAD * spacing) == 0
    # A surface riddled with pinholes is worse than a bridge.
    kernel = np.ones((_SPECK_PX, _SPECK_PX), np.uint8)
    opened = cv2.dilate(cv2.erode(bridge.view(np.uint8), kernel), kernel, anchor=(0, 0))
    if not opened.any():
        return support.sampled(*axes)
    kept = support.cut(np.asarray(opened > 0)).sampled(*axes)
    labels, parts = enclosed_parts(~kept)
    for label, left, top, width, height in parts.tolist():
        box = np.s_[top:top + height, left:left + width]
        inside = support.sampled(axes[0][box[1]], axes[1][box[0]])
        rows, columns = np.nonzero((labels[box] == label) & inside)
        rows, columns = rows + top, columns + left
        x, y = support.coordinates(axes[0][columns], axes[1][rows])
        places = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
        if (len(rows) and np.ptp(surface.values[0][places]) <= _MAX_STEP_MM
                and slope2[places].max() <= _STEEPEST**2):
            kept[rows, columns] = True
    return kept
