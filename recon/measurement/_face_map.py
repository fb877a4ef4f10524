"""A face seen from ahead: its dense points as heights over its own plane of symmetry.

The head's own frame: x to the right in the image, y down along the face, z backward, as a camera's
that looks at the face from ahead. x = 0 is the plane of symmetry (`find_plane`); y = z = 0 is the
tip of the nose; the pitch is that at which the face around the tip, as far as `_CORE_MM`, leans
neither forward nor backward. All of it depends on the face's shape alone, not on where it looked.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.detail import HeightField, find_plane
from denseface.recon.face import DenseCloud
from denseface.recon.numerics.scatter import splat

__all__ = ["STEP_MM", "FaceMap", "HeadFrame", "head_frame"]

_COARSE_MM = 1.3
"""Distance of the points by which plane and pitch are found, mm."""
_CORE_MM = 60.0
"""The face around the tip of the nose, by which the pitch is told: radius, mm."""
_CORE_DEPTH_MM = 60.0
"""Points farther behind the tip are not of it, mm."""
_RIDGE_MM = 12.0
"""The tip of the nose is so near to the plane of symmetry, mm."""
_TIP_MM = 4.0
"""The tip is the mean of the foremost points, as deep as 0.5 mm, within so much of the first."""
_TURNS = 6
"""How often tip and pitch are found in turn."""
_TOLERANCE = 1e-4
"""A smaller change of the pitch ends that, rad."""
STEP_MM, _HALF = 1.0, 120
"""Distance of the map's points, mm, and how many there are each way from the middle."""
_LEAST = 0.2
"""Places with a smaller sum of bilinear weights are empty."""


class HeadFrame(NamedTuple):
    """Where a head is: own coordinates are (points - tip) @ axes.T.

    axes : (3, 3) float64, rows are the unit vectors x, y, z
    tip : (3,) float64, mm
    """

    axes: Doubles
    tip: Doubles


@dataclass(frozen=True, eq=False)
class FaceMap:
    """Heights of a face in its own frame.

    Attributes
    ----------
    height : (rows, columns) float32, mm, z; NaN where there is nothing
    sigma : (rows, columns) float32, mm, standard error of the height; NaN
    at : (rows,) float64, mm: y of the rows, and x of the columns, at `STEP_MM`
    """

    height: Floats
    sigma: Floats
    at: Doubles

    @classmethod
    def of(cls, cloud: DenseCloud, frame: HeadFrame) -> Self:
        """Resample a cloud."""
        own = (cloud.points - frame.tip.astype(np.float32)) @ frame.axes.T.astype(np.float32)
        side = 2 * _HALF + 1
        columns, rows = (own[:, axis] / np.float32(STEP_MM) + _HALF for axis in (0, 1))
        inside = ((columns >= 0) & (rows >= 0) & (columns < side - 1) & (rows < side - 1))
        columns, rows = columns[inside], rows[inside]

        def spread(values: Floats) -> Floats:
            counts, sums = np.zeros((2, side, side), np.float32)
            splat(columns, rows, values, counts, sums)
            sums /= np.maximum(counts, _LEAST)
            sums[counts < _LEAST] = np.nan
            return sums

        return cls(spread(own[inside, 2]), spread(cloud.sigma[inside]),
                   STEP_MM * np.arange(-_HALF, _HALF + 1.0))


def head_frame(cloud: DenseCloud) -> HeadFrame | None:
    """Find a head's own frame; None where too little of one side of the face shows."""
    every = max(1, round(_COARSE_MM / cloud.grid_step_mm))
    kept = (cloud.cells % every == 0).all(axis=1)
    plane = find_plane(_field(cloud, kept, every))
    if plane is None:
        return None
    side = math.copysign(1.0, plane.normal[0])
    x, on_plane = side * plane.normal, side * plane.offset
    z = np.array([0.0, 0.0, 1.0])
    points = cloud.points[kept].astype(np.float64)
    points = points[np.abs(points @ x - on_plane) < _CORE_MM]
    if not (np.abs(points @ x - on_plane) < _RIDGE_MM).any():
        return None
    for _ in range(_TURNS):
        z = z - (z @ x) * x
        z /= np.linalg.norm(z)
        axes = np.stack([x, np.cross(z, x), z])
        own = points @ axes.T
        own[:, 0] -= on_plane
        tip = _tip(own)
        own -= tip
        core = (own[:, 0] ** 2 + own[:, 1] ** 2 < _CORE_MM**2) & (own[:, 2] < _CORE_DEPTH_MM)
        y = own[core, 1] - own[core, 1].mean()
        slope = float(y @ own[core, 2] / (y @ y))
        z = axes[2] - slope * axes[1]
        if abs(slope) < _TOLERANCE:
            break
    return HeadFrame(axes, (tip + np.array([on_plane, 0.0, 0.0])) @ axes)


def _tip(own: Doubles) -> Doubles:
    """Give the tip of the nose, (3,) mm, in the plane of symmetry."""
    ridge = own[np.abs(own[:, 0]) < _RIDGE_MM]
    first = ridge[ridge[:, 2].argmin()]
    near = ridge[(np.abs(ridge[:, :2] - first[:2]) < _TIP_MM).all(axis=1)]
    front = near[near[:, 2] < first[2] + 0.5]
    return np.array([0.0, front[:, 1].mean(), front[:, 2].mean()])


def _field(cloud: DenseCloud, kept: Bools, every: int) -> HeightField:
    """Give every so many rows and columns of a cloud as `find_plane` takes them."""
    planes = np.zeros((*(-(-side // every) for side in cloud.grid_shape), 3), np.float32)
    places = tuple(cloud.cells[kept].T // every)
    planes[*places, 0] = cloud.points[kept, 2]
    planes[*places, 1] = -cloud.normals[kept, 2]
    planes[*places, 2] = 1
    corner = cloud.points[0, :2] - cloud.grid_step_mm * cloud.cells[0, ::-1]
    return HeightField(planes, np.array([*corner, 0.0]), every * cloud.grid_step_mm)
