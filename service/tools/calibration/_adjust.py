"""Bundle adjustment: both cameras, their pose and every board at once, by least squares.

Each view's board is in one place for both cameras, which ties their focal lengths to each other. Of
simulated boards the pose is off as much as its covariance says, a third of what is left where each
camera stays as it was found by itself or where OpenCV's `stereoCalibrate` adjusts them, which ends
early in the valley between principal point, tangential distortion and rotation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from denseface.service.tools.calibration._camera import Lens

__all__ = ["Accuracy", "Rig", "SharedView", "adjusted"]

_INTRINSICS = 9
"""fx, fy, cx, cy, k1, k2, p1, p2, k3."""
_POSE = 6
"""Rotation vector and translation, mm."""
_SHARED = 2 * _INTRINSICS + _POSE
"""Of both cameras, before those of each board."""
_STEPS = 40

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Accuracy:
    """How far the result may be off, one standard deviation."""

    depth_focal_px: float
    color_focal_px: float
    translation_mm: float
    rotation_deg: float


class SharedView(NamedTuple):
    """Corners that both cameras see."""

    points: NDArray[np.float32]
    """(n, 3), mm, on the board."""
    depth: NDArray[np.float32]
    color: NDArray[np.float32]
    """(n, 2), pixels."""


class Rig(NamedTuple):
    """Two cameras, their pose, and where the board is in each view."""

    depth: Lens
    color: Lens
    pose: _Array
    """(6,): rotation vector and translation, depth camera to colour camera."""
    boards: _Array
    """(views, 6): the same, board to depth camera."""

    def errors(self, views: Sequence[SharedView]) -> list[tuple[_Array, _Array]]:
        """Give where each corner should be less where it is, (n, 2) pixels, in both images."""
        found = []
        for board, view in zip(self.boards, views, strict=True):
            r, t = board[:3], board[3:]
            r2, t2 = cv2.composeRT(r, t, self.pose[:3], self.pose[3:])[:2]
            found.append((self.depth.project(view.points, r, t) - view.depth,
                          self.color.project(view.points, r2, t2) - view.color))
        return found


def adjusted(
    start: Rig, views: Sequence[SharedView], *, distortion: bool = True
) -> tuple[Rig, Accuracy]:
    """Adjust a rig to the views.

    Parameters
    ----------
    distortion : adjust the coefficients that are not 0; otherwise they stay

    Returns
    -------
    the rig, and what it is worth: the covariance s^2 (J^T J)^-1 of its least squares
    """
    x = np.concatenate([_of_lens(start.depth), _of_lens(start.color), start.pose,
                        start.boards.ravel()])
    free = np.ones(len(x), bool)
    for begin in (4, _INTRINSICS + 4):
        free[begin:begin + 5] = distortion & (x[begin:begin + 5] != 0)

    def rig(values: _Array) -> Rig:
        whole = x.copy()
        whole[free] = values
        return Rig(_lens(whole[:_INTRINSICS]), _lens(whole[_INTRINSICS:2 * _INTRINSICS]),
                   whole[2 * _INTRINSICS:_SHARED], whole[_SHARED:].reshape(-1, _POSE))

    def errors(values: _Array) -> _Array:
        return np.concatenate([error.ravel() for pair in rig(values).errors(views)
                               for error in pair])

    def jacobian(values: _Array) -> _Array:
        by_all: _Array = _jacobian(rig(values), views)[:, free]
        return by_all

    fit = least_squares(errors, x[free], jacobian, x_scale="jac", max_nfev=_STEPS, xtol=1e-10,
                        ftol=1e-12)
    J = jacobian(fit.x)
    scale = np.linalg.norm(J, axis=0)  # pixels by radian and pixels by millimetre side by side
    variance = np.zeros(len(x))
    variance[free] = np.diag(np.linalg.pinv((J / scale).T @ (J / scale))) / scale**2
    variance *= 2 * fit.cost / max(J.shape[0] - J.shape[1], 1)
    of_pose = variance[2 * _INTRINSICS:_SHARED]
    return rig(fit.x), Accuracy(
        float(np.sqrt(variance[0])), float(np.sqrt(variance[_INTRINSICS])),
        float(np.sqrt(of_pose[3:].sum())), float(np.degrees(np.sqrt(of_pose[:3].sum()))))


def _jacobian(rig: Rig, views: Sequence[SharedView]) -> _Array:
    blocks = []
    for number, (board, view) in enumerate(zip(rig.boards, views, strict=True)):
        own = slice(_SHARED + _POSE * number, _SHARED + _POSE * (number + 1))
        of_depth, of_color = np.zeros((2, 2 * len(view.points), _SHARED + rig.boards.size))
        in_depth = _derivatives(rig.depth, view.points, board[:3], board[3:])
        of_depth[:, own], of_depth[:, :_INTRINSICS] = in_depth[:, :_POSE], in_depth[:, _POSE:]
        # composeRT: r3, t3, then d(r3) and d(t3) by each of r1, t1, r2, t2.
        r3, t3, *chain = cv2.composeRT(board[:3], board[3:], rig.pose[:3], rig.pose[3:])
        in_color = _derivatives(rig.color, view.points, r3, t3)
        moved = in_color[:, :_POSE] @ np.block([list(chain[:4]), list(chain[4:])])
        of_color[:, own], of_color[:, 2 * _INTRINSICS:_SHARED] = moved[:, :_POSE], moved[:, _POSE:]
        of_color[:, _INTRINSICS:2 * _INTRINSICS] = in_color[:, _POSE:]
        blocks += [of_depth, of_color]
    return np.concatenate(blocks)


def _derivatives(
    lens: Lens, points: NDArray[np.float32], rotation: NDArray[Any], shift: NDArray[Any]
) -> _Array:
    """Give (2 n, 15): of pixels by rotation, shift and intrinsics."""
    _, jacobian = cv2.projectPoints(points.astype(np.float64), rotation, shift, lens.matrix,
                                    lens.distortion)
    return np.asarray(jacobian[:, :_POSE + _INTRINSICS], np.float64)


def _of_lens(lens: Lens) -> _Array:
    K = lens.matrix
    return np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *lens.distortion])


def _lens(values: _Array) -> Lens:
    fx, fy, cx, cy = values[:4]
    return Lens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), values[4:])
