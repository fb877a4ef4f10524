"""One camera, from views of a board."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture import CameraModel
from denseface.service.errors import CalibrationFailedError

__all__ = ["Lens", "calibrate_camera"]

_MODELS = (
    ((4, 1), 0),
    ((1,), cv2.CALIB_FIX_K3),
    ((0, 2, 3), cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_K2),
    ((), cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K1 | cv2.CALIB_ZERO_TANGENT_DIST),
)
"""Distortions, the richest first: coefficients (of k1, k2, p1, p2, k3) one of which must stand out,
and the flags that leave the others at 0. What does not stand out says more of the noise than of the
lens, and runs wild where no corner was."""
_STANDS_OUT = 3.0
"""Standard deviations."""
_ITERATIONS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-8)

_Array = NDArray[np.float64]


class Lens(NamedTuple):
    """Intrinsics as OpenCV has them."""

    matrix: _Array
    """(3, 3)."""
    distortion: _Array
    """(5,): k1, k2, p1, p2, k3."""

    @classmethod
    def of(cls, matrix: NDArray[Any], distortion: NDArray[Any]) -> Self:
        """Take what OpenCV gives."""
        return cls(matrix.astype(np.float64), distortion.ravel()[:5].astype(np.float64))

    def project(
        self, points: NDArray[np.float32], rotation: NDArray[Any], shift: NDArray[Any]
    ) -> _Array:
        """Give where points of the board are seen, (n, 2) pixels."""
        pixels, _ = cv2.projectPoints(points, rotation, shift, self.matrix, self.distortion)
        return pixels.reshape(-1, 2).astype(np.float64)

    def camera(self, size: tuple[int, int]) -> CameraModel:
        """Give the camera; ValueError where it is none that can be."""
        K, distortion = self.matrix, self.distortion
        return CameraModel.model_validate({
            "width": size[0], "height": size[1], "fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2],
            "cy": K[1, 2], "distortion": distortion.tolist()})


def calibrate_camera(
    views: Sequence[tuple[NDArray[np.float32], NDArray[np.float64]]], size: tuple[int, int]
) -> Lens:
    """Calibrate a camera by points of a board, (n, 3) mm, and where they are seen, (n, 2) pixels.

    The richest distortion whose coefficients stand out of their noise, and that can be inverted
    over the image, is taken.

    Raises
    ------
    CalibrationFailedError
        No camera sees such corners.
    """
    points = [np.ascontiguousarray(board, np.float32) for board, _ in views]
    pixels = [np.ascontiguousarray(seen, np.float32) for _, seen in views]
    for telling, flags in _MODELS:
        try:
            _, K, distortion, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
                points, pixels, size, np.eye(3), np.zeros(5), flags=flags, criteria=_ITERATIONS)
            lens = Lens.of(K, distortion)
            lens.camera(size)
        except (cv2.error, ValueError):
            continue
        spread = deviations.ravel()[4:9]
        if not telling or any(abs(lens.distortion[one]) > _STANDS_OUT * spread[one]
                              for one in telling):
            return lens
    raise CalibrationFailedError("the corners are those of no camera: is the board of that kind?")
