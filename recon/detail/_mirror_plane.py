"""The plane that mirrors a face onto itself best.

The mirror images of points a few millimetres apart should lie on the face. A coarse search over
turns and offsets starts from the direction in which the face curves most, ear to ear; Gauss-Newton
steps from the best few end it. The weights of Geman and McClure, 1987, bound what large distances
count, so that a swollen cheek does not draw the plane.
"""

import math
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.detail import _mirror_kernels as kernels

_TURNS = np.radians(np.arange(-40.0, 41.0, 10.0))
"""Turns of the planes to start from, away from the view from ahead, rad."""
_OFFSETS_MM = np.arange(-24.0, 25.0, 8.0)
"""Their distances from the middle of the face's points, mm."""
_STARTS = 4
"""How many of them are refined."""
_SPARSE_MM = 11.0
"""Distance of points in the coarse search, mm."""
_DENSE_MM = 4.0
"""Distance of points in the last steps, mm."""
_FAR_MM = 8.0
"""In the coarse search, larger distances of a mirror image cost the same, mm."""
_FAR_REFINED_MM = 5.0
"""The same when refined planes are compared, mm."""
_MISSING = 0.1
"""Cost of a mirror image that meets nothing, as a part of the largest."""
_SCALE_MM = 2.0
"""Scale of the robust weights, mm."""
_COARSE_STEPS = 6
"""Most Gauss-Newton steps from each start."""
_FINAL_STEPS = 10
"""Most Gauss-Newton steps from the best of them, on dense points."""
_TOLERANCE_MM = 0.01
"""Smaller changes of the plane end the steps, mm."""
_MIN_MET = 0.4
"""Part of the face that its mirror image must meet for the plane to be told."""
_MIN_POINTS = 200
"""Fewer dense points tell no plane."""
_MIN_FACING = 0.2
"""Points that face the camera by less (cosine) do not count."""


class MirrorPlane(NamedTuple):
    """The points p with normal . p = offset, mm; the normal, (3,), is of unit length."""

    normal: Doubles
    offset: float


def find_plane(field: kernels.HeightField) -> MirrorPlane | None:
    """Find the plane of symmetry of a face; None where too little of one of its sides shows."""
    points = kernels.sample_points(field, max(1, round(_DENSE_MM / field.step)), _MIN_FACING)
    if len(points) < _MIN_POINTS:
        return None
    middle = points.mean(axis=0)
    points -= middle
    centered = field._replace(origin=field.origin - middle)
    some = np.ascontiguousarray(points[::round((_SPARSE_MM / _DENSE_MM) ** 2)])
    start = _coarse_plane(centered, some)
    if start is None:
        return None
    normal, offset, met = kernels.refine_plane(
        centered, points, *start, _SCALE_MM, _FINAL_STEPS, _TOLERANCE_MM)
    if met < _MIN_MET * len(points):
        return None
    return MirrorPlane(normal, offset + float(normal @ middle))


def _coarse_plane(field: kernels.HeightField, points: Doubles) -> tuple[Doubles, float] | None:
    """Search turns and offsets; give the cheapest normal and offset after some refinement."""
    angle = kernels.principal_curvature_angle(points)
    level = np.array([math.cos(angle), math.sin(angle), 0.0])
    normals = np.cos(_TURNS)[:, None] * level + np.sin(_TURNS)[:, None] * (0.0, 0.0, 1.0)
    costs = kernels.mirror_costs(
        field, points, normals, _OFFSETS_MM, _FAR_MM**2, _MISSING * _FAR_MM**2)
    best, least = None, np.inf
    for turned in np.argsort(costs.min(axis=1), kind="stable")[:_STARTS]:
        normal, offset, met = kernels.refine_plane(
            field, points, normals[turned], _OFFSETS_MM[costs[turned].argmin()], _SCALE_MM,
            _COARSE_STEPS, _TOLERANCE_MM)
        cost = kernels.mirror_costs(
            field, points, normal[None], np.array([offset]), _FAR_REFINED_MM**2,
            _MISSING * _FAR_REFINED_MM**2)[0, 0]
        if met >= _MIN_MET * len(points) and cost < least:
            best, least = (normal, offset), cost
    return best
