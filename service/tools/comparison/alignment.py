"""One face laid on another: iterated closest points on the parts that do not move.

Point to plane with the mean of both normals (Rusinkiewicz, 2019, doi:10.1145/3306346.3323037),
Tukey's weights (Beaton and Tukey, 1974) with a scale by the median residual. Where to start is told
by the mean face laid on either.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.service.tools.comparison.regions import HeadPlace, rigidity
from denseface.service.tools.comparison.surface import Pose, Surface

__all__ = ["Alignment", "align"]

_COARSE = ((30.0, 6), (12.0, 8), (6.0, 8))
"""Largest distances that count, mm, and steps with them."""
_STEPS = 30
"""With Tukey's weights, at most."""
_TUKEY = 4.685
"""Standard deviations at which its weight is zero: 95 % efficient for normal errors."""
_LEAST_SCALE_MM = 0.15
_LEAST_COSINE = 0.6
"""Normals that differ by more belong to different parts."""
_STILL_RAD, _STILL_MM = 1e-5, 1e-3
"""Smaller steps end it."""
_STEP_MM = 3.0
"""Distance of the points that are laid on the other surface."""
_FEWEST = 50
_FAR_MM = 3.0
"""A nearest point that is farther aside is not below the point."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a surface lies on a reference.

    Attributes
    ----------
    pose : from its frame to the reference's
    rms_mm : root mean square of the residuals under their weights
    overlap : what part of the points of bone met the reference, 0-1
    steps : how many were taken
    """

    pose: Pose
    rms_mm: float
    overlap: float
    steps: int


def align(
    surface: Surface, reference: Surface, *, place: HeadPlace | None, start: Pose
) -> Alignment | None:
    """Lay a surface on a reference; None where too little of them meets.

    Parameters
    ----------
    place : of the head in the reference's frame; without one all parts weigh the same
    start : from the surface's frame to the reference's, within 40 degrees or so
    """
    points = surface.thinned(_STEP_MM)
    pose, steps = start, 0
    for far, count in _COARSE:
        for _ in range(count):
            step = _step(points, reference, place, pose, far, tukey=False)
            if step is None:
                return None
            pose, steps = step.pose @ pose, steps + 1
            if step.still:
                break
    rms, overlap = np.inf, 0.0
    for _ in range(_STEPS):
        step = _step(points, reference, place, pose, _COARSE[-1][0], tukey=True)
        if step is None:
            return None
        pose, steps, rms, overlap = step.pose @ pose, steps + 1, step.rms_mm, step.overlap
        if step.still:
            break
    return Alignment(_tidy(pose), rms, overlap, steps)


@dataclass(frozen=True, eq=False)
class _Step:
    pose: Pose
    rms_mm: float
    overlap: float
    still: bool


def _step(
    points: Surface, reference: Surface, place: HeadPlace | None, pose: Pose, far: float, *,
    tukey: bool,
) -> _Step | None:
    moved = points.moved(pose)
    away, nearest = (one[:, 0] for one in reference.nearest(moved.points, 1, far))
    met = np.isfinite(away)
    met[met] = (moved.normals[met] * reference.normals[nearest[met]]).sum(axis=1) > _LEAST_COSINE
    weight = np.ones(len(moved)) if place is None else rigidity(place.own(moved.points))
    overlap = float(weight[met].sum() / max(weight.sum(), 1e-9))
    if met.sum() < _FEWEST:
        return None
    p, q = moved.points[met], reference.points[nearest[met]]
    normals = moved.normals[met] + reference.normals[nearest[met]]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rest = ((q - p) * normals).sum(axis=1)
    weight = weight[met] / (
        _LEAST_SCALE_MM**2 + moved.sigma[met] ** 2 + reference.sigma[nearest[met]] ** 2)
    if tukey:
        aside = np.sqrt(np.maximum(((q - p) ** 2).sum(axis=1) - rest**2, 0))
        scale = max(1.4826 * _weighted_median(np.abs(rest), weight), _LEAST_SCALE_MM)
        weight = weight * np.maximum(1 - (rest / (_TUKEY * scale)) ** 2, 0) ** 2
        weight = weight * (aside < _FAR_MM)
    middle = p.mean(axis=0)
    J = np.concatenate([np.cross(p - middle, normals), normals], axis=1)
    weighted = J * weight[:, None]
    moved_by = np.linalg.solve(weighted.T @ J + 1e-6 * np.eye(6), weighted.T @ rest)
    turn = Rotation.from_rotvec(moved_by[:3]).as_matrix()
    shift = middle + moved_by[3:] - turn @ middle
    rms = float(np.sqrt(weight @ rest**2 / max(weight.sum(), 1e-9)))
    still = bool(np.linalg.norm(moved_by[:3]) < _STILL_RAD
                 and np.linalg.norm(moved_by[3:]) < _STILL_MM)
    return _Step(Pose(turn, shift), rms, overlap, still)


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(below, below[-1] / 2)]])


def _tidy(pose: Pose) -> Pose:
    """Take off what rounding adds to a rotation."""
    u, _, v = np.linalg.svd(pose.rotation)
    return Pose(np.asarray(u @ v, np.float64), pose.shift)
