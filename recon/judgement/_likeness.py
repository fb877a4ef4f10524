"""What a surface has in common with the mean face: the figures that a result is judged by."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.judgement._placing import mean_face, placements
from denseface.recon.judgement._relief_kernels import compare

__all__ = ["FAR_MM", "Likeness", "likenesses"]

_WINDOWS_MM = np.array([(85.0, -85.0, 85.0), (60.0, -60.0, 75.0), (50.0, -50.0, 40.0)])
"""On the mean face, half the width and the ends of the height: face; eyes to mouth; eyes and
nose."""
FAR_MM = 10.0
"""What is farther from the mean face is left out: a hand, hair."""
_LEAST_MM = 1.0
"""Smaller distances from the mean face tell nothing."""
_GAINS = (0.2, 5.0)
"""Bounds within which it tells."""
_FREE_ROLL_DEG, _FREE_TILT_DEG = 30.0, 25.0
"""Heads that are turned by no more than this are as common as any."""


class Likeness(NamedTuple):
    """How a surface compares with the mean face that was laid on it.

    Attributes
    ----------
    face, middle, nose : correlations of its relief with the mean face's, over all of it, from eyes
        to mouth, and about eyes and nose; relief is what a quadric leaves
    gain : regression of its relief, from eyes to mouth, on the mean face's
    distance_mm : root mean square distance from the mean face
    roll_deg, tilt_deg : how far the head is tipped aside, and lifted or lowered
    placement : (13,), how it was laid on, by `_mould_kernels`
    """

    face: float
    middle: float
    nose: float
    gain: float
    distance_mm: float
    roll_deg: float
    tilt_deg: float
    placement: Doubles

    @property
    def figures(self) -> Doubles:
        """(7,), what the score is a sum of."""
        return np.array([
            self.face, self.middle, self.nose, math.log(max(self.distance_mm, _LEAST_MM)),
            abs(math.log(min(max(self.gain, _GAINS[0]), _GAINS[1]))),
            max(0.0, abs(self.roll_deg) - _FREE_ROLL_DEG) / 30,
            max(0.0, abs(self.tilt_deg) - _FREE_TILT_DEG) / 30])


def likenesses(
    points: Doubles, ways: Callable[[Doubles], Iterator[Doubles]] = placements
) -> Iterator[Likeness]:
    """Lay the mean face on points, (n, 3) mm, in some ways, the most likely first."""
    for placement in ways(points):
        face, middle, nose, (distance, _, _) = compare(
            mean_face(), points, placement, _WINDOWS_MM, FAR_MM)
        yield Likeness(
            float(face[0]), float(middle[0]), float(nose[0]), float(middle[1]), float(distance),
            math.degrees(math.atan2(placement[3], placement[0])),
            math.degrees(math.asin(min(max(placement[7], -1.0), 1.0))), placement)
