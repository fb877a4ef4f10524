"""Whether anything as large as a head is near enough: depth tells, in a tenth of a millisecond."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from denseface.capture.frame import RgbdFrame

__all__ = ["FARTHEST_MM", "NEAREST_MM", "SPARSE", "SparseDepth"]

SPARSE = 4
"""Every so many pixels, along rows and columns, are looked at."""
NEAREST_MM, FARTHEST_MM = 400.0, 1300.0
"""Where people who want to be captured stand."""
_MIN_AREA_MM2 = 120.0 * 150.0
"""A head's front; what is smaller is nobody."""
_SAME_MM = 30.0
"""A depth that changed by less did not change: five times the noise at the farthest."""
_SAME_SHARE = 0.01
"""Share of the pixels in range that may change while the scene counts as still."""


@dataclass(frozen=True, eq=False)
class SparseDepth:
    """Every k-th pixel of a depth image.

    Attributes
    ----------
    counts : (rows, columns) uint16, the frame's own unit
    in_range : (rows, columns) bool
    area_mm2 : how much lies in the range, seen from the front
    """

    counts: NDArray[np.uint16]
    in_range: NDArray[np.bool_]
    area_mm2: float
    unit_mm: float

    @classmethod
    def of(cls, frame: RgbdFrame) -> Self:
        """Look at a frame."""
        unit = frame.depth_meaning.unit_um / 1000
        counts = frame.depth[::SPARSE, ::SPARSE].copy()
        in_range = (counts >= NEAREST_MM / unit) & (counts <= FARTHEST_MM / unit)
        z = counts[in_range].astype(np.float32) * np.float32(unit)
        camera = frame.depth_camera
        area = float(np.dot(z, z)) * SPARSE**2 / (camera.fx * camera.fy)
        return cls(counts, in_range, area, unit)

    @property
    def somebody(self) -> bool:
        """Whether as much as a head is near enough."""
        return self.area_mm2 >= _MIN_AREA_MM2

    def same_as(self, other: Self) -> bool:
        """Say whether nothing moved since another look at the same scene."""
        if self.counts.shape != other.counts.shape or self.unit_mm != other.unit_mm:
            return False
        either = self.in_range | other.in_range
        both = (self.counts > 0) & (other.counts > 0)
        changed = np.abs(self.counts.astype(np.int32) - other.counts) * self.unit_mm > _SAME_MM
        return int((changed & both & either).sum()) <= _SAME_SHARE * int(either.sum())
