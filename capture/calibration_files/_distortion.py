"""Lens distortion in other numbers of coefficients than ours."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import CameraModel
from denseface.capture.errors import CalibrationError

__all__ = ["camera_with_distortion"]

_COUNTS = (0, 4, 5, 8, 12, 14)
"""OpenCV's: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]."""
_GRID = 33
"""Points a side at which the two models are compared."""
_TOLERANCE_PX = 0.25
"""Largest distance between both over the image; a corner is found to a tenth."""
_INVERT_STEPS = 100


def camera_with_distortion(camera: CameraModel, coefficients: Sequence[float]) -> CameraModel:
    """Give a camera the distortion of OpenCV's coefficients.

    Five are taken as they are, four leave k3 at 0. Eight (a rational model) are replaced by the
    five that come closest to them over the image.

    Raises
    ------
    CalibrationError
        Another number of them, or five cannot stand for them.
    """
    if len(coefficients) not in _COUNTS:
        raise CalibrationError(f"has {len(coefficients)} distortion coefficients, expected 4, 5 "
                               "or 8 (OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6]])")
    padded = np.zeros(14)
    padded[:len(coefficients)] = coefficients
    if not np.isfinite(padded).all():
        raise CalibrationError("has a distortion coefficient that is no number")
    if padded[8:].any():
        raise CalibrationError("has thin prism or tilt coefficients, expected k1 k2 p1 p2 k3 and "
                               "at most k4 k5 k6")
    if padded[5:8].any():
        padded[:5] = _closest_five(camera, padded[:8])
    five = tuple(float(value) for value in padded[:5])
    return CameraModel(**{**camera.model_dump(), "distortion": five})


def _closest_five(camera: CameraModel, eight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit the five coefficients by least squares: the distorted position is linear in them."""
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, _GRID),
                       np.linspace(0, camera.height - 1, _GRID))
    xd, yd = ((u - camera.cx) / camera.fx).ravel(), ((v - camera.cy) / camera.fy).ravel()
    x, y = xd, yd
    with np.errstate(all="ignore"):
        for _ in range(_INVERT_STEPS):  # by fixed point, as OpenCV does
            ex, ey = _rational(x, y, eight)
            x, y = x + (xd - ex), y + (yd - ey)
    ex, ey = _rational(x, y, eight)
    if not np.allclose((ex, ey), (xd, yd), atol=1e-6):
        raise CalibrationError("has a distortion of 8 coefficients that cannot be inverted over "
                               "the whole image")
    r2 = x * x + y * y
    rows_x = [x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3]
    rows_y = [y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3]
    A = np.concatenate([camera.fx * np.stack(rows_x, 1), camera.fy * np.stack(rows_y, 1)])
    b = np.concatenate([camera.fx * (xd - x), camera.fy * (yd - y)])
    five: NDArray[np.float64] = np.linalg.lstsq(A, b)[0]
    worst = float(np.hypot(*np.split(A @ five - b, 2)).max())
    if worst > _TOLERANCE_PX:
        raise CalibrationError(
            f"has a distortion of 8 coefficients which k1 k2 p1 p2 k3 meet only to {worst:.2f} "
            f"pixels (at most {_TOLERANCE_PX:g}): undistort the images first")
    return five


def _rational(
    x: NDArray[np.float64], y: NDArray[np.float64], eight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    k1, k2, p1, p2, k3, k4, k5, k6 = eight
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
