"""On which side of what stands before them shadows lie, in which no depth is measured.

The projector of a PrimeSense sensor is to the right of its depth camera, so that shadows are to the
left of what casts them: in a mirrored image they are to the right.
"""

import numpy as np

from denseface.capture.agreement._outlines import Outlines
from denseface.capture.calibration import CameraModel

__all__ = ["shadow_side"]

_BASELINE_MM = 75.0
"""From the depth camera to the projector (LDDIS)."""
_WIDE_PX = 6.0
"""Outlines whose shadow would be narrower tell nothing."""
_SHADOWED = 0.4
"""Share of a shadow's width from which there is one; registration to colour takes a third."""
_FEWEST = 60
"""Outlines to each side, with fewer of which nothing is said."""
_CLEARLY = 0.3
"""By how much more of the outlines of one side are shadowed."""


def shadow_side(outlines: Outlines, camera: CameraModel) -> int:
    """Say where shadows lie: -1 to the left, 1 to the right, 0 where that is not clear."""
    width = camera.fx * _BASELINE_MM * (1 / outlines.z_mm - 1 / outlines.behind_mm)
    shares = []
    for side in (-1, 1):
        chosen = outlines.upright & (outlines.side == side) & (width >= _WIDE_PX)
        if np.count_nonzero(chosen) < _FEWEST:
            return 0
        shares.append(float(np.mean(outlines.gap[chosen] > _SHADOWED * width[chosen])))
    left, right = shares
    if abs(left - right) < _CLEARLY:
        return 0
    return -1 if left > right else 1
