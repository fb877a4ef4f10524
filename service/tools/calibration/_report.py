"""What a calibration rests on, as numbers and as a picture."""

from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from denseface.capture import Calibration, CameraModel
from denseface.service.tools.calibration._solve import Solution, ViewResult

__all__ = ["CalibrationReport", "picture"]

_PANEL = 720
"""Width of a camera's panel, pixels."""
_MARGIN, _HEADER, _LINE = 16, 64, 26
"""Around each panel, above it, and of a line of text, pixels."""
_MAGNIFIED = 60.0
"""By which errors are drawn larger."""
_LARGE_PX = 1.0
"""Error of a corner that is drawn all red."""
_BACKGROUND, _FIELD, _INK, _FAINT, _DROPPED = (
    (24, 22, 20), (46, 43, 40), (240, 238, 236), (168, 162, 156), (110, 104, 98))
"""BGR."""


class ViewReport(BaseModel):
    """One pair of images."""

    model_config = ConfigDict(frozen=True)

    name: str
    used: bool
    rms_px: float | None
    """Reprojection error of both images, pixels."""
    why_not: str
    depth_corners: int
    color_corners: int


class CalibrationReport(BaseModel):
    """A calibration, what it is worth, and each view."""

    model_config = ConfigDict(frozen=True)

    calibration: Calibration
    rms_px: float
    """Reprojection error of all corners that were used, pixels."""
    depth_focal_sd_px: float
    color_focal_sd_px: float
    translation_sd_mm: float
    rotation_sd_deg: float
    """Standard deviations, propagated from the corners' errors."""
    views: tuple[ViewReport, ...]
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, solution: Solution, warnings: tuple[str, ...] = ()) -> Self:
        """Sum up a solution."""
        return cls(
            calibration=solution.calibration, rms_px=round(solution.rms_px, 4),
            depth_focal_sd_px=round(solution.accuracy.depth_focal_px, 3),
            color_focal_sd_px=round(solution.accuracy.color_focal_px, 3),
            translation_sd_mm=round(solution.accuracy.translation_mm, 3),
            rotation_sd_deg=round(solution.accuracy.rotation_deg, 4),
            views=tuple(ViewReport(
                name=view.name, used=view.rms_px is not None, why_not=view.why_not,
                rms_px=None if view.rms_px is None else round(view.rms_px, 4),
                depth_corners=len(view.depth.ids) if view.depth else 0,
                color_corners=len(view.color.ids) if view.color else 0)
                for view in solution.views), warnings=warnings)


def picture(solution: Solution) -> bytes:
    """Draw, as a PNG file, where the board was in both images and how far each corner is off."""
    calibration = solution.calibration
    panels = [_panel("depth camera", calibration.depth, solution.views, depth=True),
              _panel("colour camera", calibration.color, solution.views, depth=False)]
    height = max(panel.shape[0] for panel in panels)
    canvas = np.full((_HEADER + height + 3 * _LINE, 2 * (_PANEL + 2 * _MARGIN), 3), _BACKGROUND,
                     np.uint8)
    for number, panel in enumerate(panels):
        left = _MARGIN + number * (_PANEL + 2 * _MARGIN)
        canvas[_HEADER:_HEADER + panel.shape[0], left:left + _PANEL] = panel
    used = sum(view.rms_px is not None for view in solution.views)
    accuracy, pose = solution.accuracy, calibration.depth_to_color
    x, y, z = pose.translation_mm
    _write(canvas, f"{used} of {len(solution.views)} views, reprojection error "
           f"{solution.rms_px:.3f} px; errors are drawn {_MAGNIFIED:g} times as long",
           (_MARGIN, 26))
    for line, text in enumerate((
            f"depth to colour: {x:.2f}, {y:.2f}, {z:.2f} mm, +- {accuracy.translation_mm:.2f} mm, "
            f"+- {accuracy.rotation_deg:.3f} deg",
            f"focal length +- {accuracy.depth_focal_px:.2f} px of the depth camera, "
            f"+- {accuracy.color_focal_px:.2f} px of the colour camera")):
        _write(canvas, text, (_MARGIN, _HEADER + height + (line + 1) * _LINE), _FAINT)
    done, data = cv2.imencode(".png", canvas)
    if not done:
        raise ValueError("OpenCV could not write a PNG")
    return bytes(data)


def _panel(
    name: str, camera: CameraModel, views: tuple[ViewResult, ...], *, depth: bool
) -> NDArray[np.uint8]:
    scale = _PANEL / camera.width
    image = np.full((round(camera.height * scale), _PANEL, 3), _FIELD, np.uint8)

    def at(pixel: NDArray[np.floating]) -> tuple[int, int]:
        u, v = np.rint((pixel + 0.5) * scale).astype(int)
        return int(u), int(v)

    for view in views:
        corners, error = (view.depth, view.depth_error) if depth else (view.color, view.color_error)
        if corners is None:
            continue
        hull = np.asarray(cv2.convexHull(corners.pixels.astype(np.float32)), np.float64)
        outline = np.array([at(pixel) for pixel in hull.reshape(-1, 2)])
        cv2.polylines(image, [outline], True, _FAINT if error is not None else _DROPPED, 1,
                      cv2.LINE_AA)
        if error is None or len(error) != len(corners.pixels):
            continue
        for pixel, off in zip(corners.pixels, error, strict=True):
            bad = min(float(np.hypot(*off)) / _LARGE_PX, 1.0)
            color = (60, int(220 * (1 - bad)), int(80 + 175 * bad))
            cv2.line(image, at(pixel), at(pixel + off * _MAGNIFIED / scale), color, 1, cv2.LINE_AA)
            cv2.circle(image, at(pixel), 2, color, -1, cv2.LINE_AA)
    _write(image, f"{name}: {camera.width}x{camera.height}, focal length {camera.fx:.1f}, "
           f"{camera.fy:.1f}", (8, image.shape[0] - 10), _FAINT)
    return image


def _write(
    image: NDArray[np.uint8], text: str, at: tuple[int, int], color: tuple[int, int, int] = _INK
) -> None:
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.55, color, 1, cv2.LINE_AA)
