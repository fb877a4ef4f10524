"""The plane that mirrors a face onto itself best.

The mirror images of points a few millimetres apart should lie on the face. A coarse search over
turns and offsets begins, about the direction in which the face curves most, ear to ear; steps of
Gauss and Newton from the best few end it. Large distances count little (Geman and McClure's
weights), so that a swollen cheek does not draw the plane.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.detail._mirror_kernels import (
    mirror_costs,
    principal_curvature_angle,
    refine_plane,
    sample_points,
)

__all__ = ["MirrorPlane", "find_plane"]

# Planes to begin with: turned by so many degrees from where the face is looked at from ahead,
# passing so near the middle of its points, mm.
_TURNS = np.radians(np.arange(-40.0, 41.0, 10.0))
_OFFSETS = np.arange(-24.0, 25.0, 8.0)
# Points for the search, and for the last steps.
_SPARSE_MM = 11.0
_DENSE_MM = 4.0
# From so many starts; distances above these, mm, are all alike before and after the first steps,
# and where a mirror image meets nothing counts as a share of them.
_STARTS = 4
_FAR_MM = 8.0
_FAR_REFINED_MM = 5.0
_MISSING = 0.1
_SCALE_MM = 2.0
_FIRST_STEPS = 6
_LAST_STEPS = 10
_STILL_MM = 0.01
# Where less of the face is met by its own mirror image, there is no telling.
_LEAST_MET = 0.4
_LEAST_POINTS = 200
# Steeper points tell little.
_FACING = 0.2

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """The points p with normal . p = offset.

    Attributes
    ----------
    normal : (3,) float64, unit vector, depth camera frame
    offset : mm
    """

    normal: Floats
    offset: float


def find_plane(
    field: NDArray[np.float32], origin: tuple[float, float], step: float
) -> MirrorPlane | None:
    """Find the plane of symmetry of a face.

    Parameters
    ----------
    field : (rows, columns, k) float32: height, mm, share of the normal along z, weight; see
        `recon.detail._mirror_kernels`
    origin : (x, y) of its first point, mm
    step : distance of its points, mm

    Returns
    -------
    None where the face shows too little of one of its sides.
    """
    points = sample_points(
        field, np.asarray(origin), step, max(1, round(_DENSE_MM / step)), _FACING)
    if len(points) < _LEAST_POINTS:
        return None
    middle = points.mean(axis=0)
    points -= middle
    start = np.array([*origin, 0.0]) - middle
    some = points[::round((_SPARSE_MM / _DENSE_MM) ** 2)]
    turn = principal_curvature_angle(some)
    level = np.array([math.cos(turn), math.sin(turn), 0.0])
    normals = np.cos(_TURNS)[:, None] * level + np.sin(_TURNS)[:, None] * (0.0, 0.0, 1.0)
    costs = mirror_costs(field, start, step, some, normals, _OFFSETS, _FAR_MM**2,
                         _MISSING * _FAR_MM**2)
    best = np.inf
    for turned in np.argsort(costs.min(axis=1), kind="stable")[:_STARTS]:
        normal, offset, met = refine_plane(
            field, start, step, some, normals[turned], _OFFSETS[costs[turned].argmin()], _SCALE_MM,
            _FIRST_STEPS, _STILL_MM)
        cost = mirror_costs(field, start, step, some, normal[None], np.array([offset]),
                            _FAR_REFINED_MM**2, _MISSING * _FAR_REFINED_MM**2)[0, 0]
        if met >= _LEAST_MET * len(some) and cost < best:
            best, likeliest = cost, (normal, offset)
    if best == np.inf:
        return None
    normal, offset, met = refine_plane(
        field, start, step, points, *likeliest, _SCALE_MM, _LAST_STEPS, _STILL_MM)
    if met < _LEAST_MET * len(points):
        return None
    return MirrorPlane(normal, offset + float(normal @ middle))
