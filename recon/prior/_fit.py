"""A face of the model, fitted to heights: pose, and the weights of its modes.

The posterior of a linear Gaussian model: of all faces the likeliest, given heights with errors of
known variance and weights that are unit normals (Blanz and Vetter, 1999,
doi:10.1145/311535.311556, without their colours). A few poses of the mean face are tried first.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Doubles, Floats
from denseface.recon.prior import _fit_kernels as kernels
from denseface.recon.prior._basis import basis

__all__ = ["FittedFace", "HeadPose", "Heights", "fit_face", "mean_face"]

Heights = kernels.Heights

_COARSE = 150
"""Points of the model that find the pose."""
_YAWS = np.radians((-20.0, 0.0, 20.0))
"""Turns of the mean face to start from, where no pose is known, rad."""
_ALONG_MM = (-25.0, 0.0, 25.0)
"""Where its middle is along its own y to start from, from the heights' middle, mm."""
_COARSE_SCALES = np.array([30.0, 15.0, 8.0, 5.0])
"""Scales of the robust weights in the steps of the pose, mm."""
_NEAR_SCALES = np.array([8.0, 5.0])
"""The same where a pose is known."""
_IN_HEAD_MM = np.array([0.0, 9.0, 24.0])
"""The model's origin in the frame of such a pose: so the judgement's poses and those of fits differ
on 24 frames of the choosing heads, within 2 mm each way."""
_FINE = ((300, 4.0), (300, 3.0), (600, 3.0))
"""Steps of pose and modes: by how many points, and the scale of their weights, mm."""
_FAR_MM, _MISSING = 8.0, 0.1
"""When poses are compared: larger distances cost the same; cost of a point that meets nothing, as a
part of that."""
_MISFIT_MM = 2.0
"""Standard deviation of what one of 600 points is off the model. Faces are off by 1 mm, but
neighbours alike."""
_POSE_RIDGE = 1e-6
"""What is known of turns and shifts before: next to nothing, 1 / rad^2 and 1 / mm^2."""
_FARTHEST_MM = np.float32(1e30)
"""Behind everything, mm. Not inf: compiled code assumes finite numbers."""
_FEWEST = 100
"""Fewest heights, and points that meet one."""


class HeadPose(NamedTuple):
    """A frame in a head: x right, y down, looking toward -z, as the judgement lays its mean face.

    rotation, shift : (3, 3) and (3,) mm, to the depth camera's frame
    """

    rotation: Doubles
    shift: Doubles


@dataclass(frozen=True, eq=False)
class FittedFace:
    """A face of the model, in the frame of the heights that it was fitted to.

    Attributes
    ----------
    rotation, shift : (3, 3) and (3,) mm, from the model's frame
    weights : (k,), of the modes, in standard deviations
    rms_mm : root mean square distance from the heights, robust
    met : what part of the points that are turned to the camera meet a height, 0-1
    """

    rotation: Doubles
    shift: Doubles
    weights: Doubles
    rms_mm: float
    met: float

    def heights(
        self, origin: tuple[float, float], step: float, shape: tuple[int, int]
    ) -> tuple[Floats, Bools]:
        """Draw it on a grid.

        origin, step : x and y of the first point, and the distance of points, mm
        shape : rows, columns

        Gives the heights, mm, (rows, columns) float32, and where there are any: 0 elsewhere.
        """
        model = basis()
        posed = (model.points(self.weights) @ self.rotation.T.astype(np.float32)
                 + self.shift.astype(np.float32))
        heights = np.full(shape, _FARTHEST_MM, np.float32)
        kernels.draw(posed, model.triangles, origin, step, heights)
        known = heights < _FARTHEST_MM
        np.copyto(heights, np.float32(0), where=~known)
        return heights, known


def mean_face(distance_mm: float) -> FittedFace:
    """Give the mean face, upright and looking at the camera, at a distance, mm."""
    return FittedFace(np.eye(3), np.array([0.0, 0.0, distance_mm]),
                      np.zeros(basis().modes.shape[2]), 0.0, 1.0)


def fit_face(field: Heights, pose: HeadPose | None = None) -> FittedFace | None:
    """Fit a face to heights; None where too few of its points meet them.

    field : of a face that is within 30 degrees or so of upright, facing the camera, -z
    pose : of the head, where that is known, about: any roll will do
    """
    measured = cv2.sumElems(field.weights)[0]
    if measured < _FEWEST:
        return None
    model = basis()
    if pose is None:
        rotations, shifts = _starts(field, measured)
        scales = _COARSE_SCALES
    else:
        rotations, shifts = pose.rotation[None].copy(), (
            pose.shift + pose.rotation @ _IN_HEAD_MM)[None]
        scales = _NEAR_SCALES
    best = kernels.best_pose(
        field, model.vertices[:_COARSE], model.normals[:_COARSE], rotations, shifts,
        scales, _FAR_MM**2, _MISSING * _FAR_MM**2)
    return _fit_modes(field, rotations[best], shifts[best])


def _starts(field: Heights, measured: float) -> tuple[Doubles, Doubles]:
    """Give rotations, (s, 3, 3), and shifts, (s, 3) mm, of the mean face to start from."""
    turned = np.array([cv2.Rodrigues(np.array([0, yaw, 0]))[0] for yaw in _YAWS])
    rotations = np.repeat(turned, len(_ALONG_MM), axis=0)
    shifts = rotations[:, :, 1] * np.tile(_ALONG_MM, len(turned))[:, None]
    for axis in (0, 1):
        weights = field.weights.sum(axis=axis)
        middle = float(weights @ np.arange(len(weights))) / measured
        shifts[:, axis] += field.origin[axis] + field.step * middle
    return rotations, shifts


def _fit_modes(field: Heights, rotation: Doubles, shift: Doubles) -> FittedFace | None:
    """Take Gauss-Newton steps of pose and modes."""
    model = basis()
    most, _ = _FINE[-1]
    weights = np.zeros(model.modes.shape[2])
    ridge = np.r_[np.full(6, _POSE_RIDGE), np.ones(len(weights))]
    J = np.empty((most, 6 + len(weights)), np.float32)
    rests, trust = np.empty(most, np.float32), np.empty(most, np.float32)
    for some, scale in _FINE:
        count, seen = kernels.equations(
            field, model.points(weights, some), model.normals[:some], model.modes[:some],
            rotation, shift, scale, J, rests, trust)
        if count * most < _FEWEST * some:
            return None
        met, rest, trusted = J[:count], rests[:count], trust[:count]
        weighted = met * (trusted * np.float32(most / some / _MISFIT_MM**2))[:, None]
        precision = (weighted.T @ met).astype(np.float64)
        precision[np.diag_indices_from(precision)] += ridge
        right = -(rest @ weighted).astype(np.float64)
        right[6:] -= weights
        moved = np.linalg.solve(precision, right)
        rotation = cv2.Rodrigues(moved[:3])[0] @ rotation
        shift = shift + moved[3:6]
        weights += moved[6:]
    rms = float(np.sqrt(trusted @ (rest * rest) / max(float(trusted.sum()), 1e-6)))
    return FittedFace(rotation, shift, weights, rms, count / seen)
