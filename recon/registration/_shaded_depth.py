"""Depth shaded as a relief: the picture of a sensor that has no colour camera."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Bytes

__all__ = ["shaded_depth", "with_shaded_depth", "without_color"]

_SMOOTH_TANGENT = 2.5 / 575.8
"""Standard deviation of the smoothing by the focal length: 2.5 pixels of a Kinect v1, which takes
most of the noise out of the slopes and leaves eye sockets, nose and mouth."""
_LIGHT = (0.0, -0.6, -1.0)
"""Where the light comes from: the camera and above, as on most photographs, so that eye sockets
are dark as the cascades expect them."""
_MARGIN = 4
"""Standard deviations beyond which that changes nothing."""
_LEAST_MEASURED = 0.05
"""Of the weight around a pixel; below, it is black."""


def shaded_depth(depth: NDArray[np.uint16], camera: CameraModel, unit_mm: float) -> Bytes:
    """Shade a depth image by Lambert's cosine law under one distant light.

    Parameters
    ----------
    depth : (H, W) uint16, counts of `unit_mm`, 0 = no reading
    camera : whose pixels they are; of another size where the image was shrunk

    Returns
    -------
    (H, W) uint8, 0 where nothing was measured
    """
    return _shaded(depth, camera.fx * depth.shape[1] / camera.width, unit_mm)


def _sigma(focal_px: float) -> float:
    return max(focal_px * _SMOOTH_TANGENT, 0.8)


def _shaded(depth: NDArray[np.uint16], focal_px: float, unit_mm: float) -> Bytes:
    sigma = _sigma(focal_px)
    measured = (depth > 0).astype(np.float32)
    weight = cv2.GaussianBlur(measured, (0, 0), sigma)
    # Normalized convolution: what is missing pulls no slope to zero.
    z = cv2.GaussianBlur(depth * np.float32(unit_mm), (0, 0), sigma) / np.maximum(weight, 1e-6)
    pixel_mm = np.maximum(z, 1.0) / np.float32(focal_px)
    dz_dx = cv2.Sobel(z, cv2.CV_32F, 1, 0, scale=1 / 8) / pixel_mm
    dz_dy = cv2.Sobel(z, cv2.CV_32F, 0, 1, scale=1 / 8) / pixel_mm
    x, y, back = np.array(_LIGHT, np.float32) / np.linalg.norm(_LIGHT)
    # The normal toward the camera is (dz/dx, dz/dy, -1).
    cosine = (dz_dx * x + dz_dy * y - back) / np.sqrt(1 + dz_dx * dz_dx + dz_dy * dz_dy)
    shade: Bytes = (np.clip(cosine, 0, 1) * 255).astype(np.uint8)
    shade[weight < _LEAST_MEASURED] = 0
    return shade


def without_color(frame: RgbdFrame) -> RgbdFrame:
    """Give the frame that a sensor without a colour camera would have taken."""
    camera = frame.depth_camera
    return replace(frame, color=None, registered=False, color_timestamp_us=frame.depth_timestamp_us,
                   calibration=Calibration(depth=camera, color=camera))


def with_shaded_depth(frame: RgbdFrame, window: tuple[slice, slice] | None = None) -> RgbdFrame:
    """Give a frame without colour its shaded depth in place of it; another one as it is.

    window : rows and columns that are needed; the rest may be black
    """
    if frame.color is not None:
        return frame
    camera = frame.depth_camera
    unit_mm = frame.depth_meaning.unit_um / 1000
    shade = np.zeros(frame.depth.shape, np.uint8)
    margin = round(_MARGIN * _sigma(camera.fx))
    rows, columns = (slice(max(part.start - margin, 0), part.stop + margin)
                     for part in window or (slice(0, camera.height), slice(0, camera.width)))
    shade[rows, columns] = _shaded(frame.depth[rows, columns], camera.fx, unit_mm)
    return replace(frame, color=np.repeat(shade[..., None], 3, axis=2), registered=True,
                   calibration=Calibration(depth=camera, color=camera))
