"""Depth shaded as a relief: the picture of a sensor that has no colour camera."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Bytes

__all__ = ["shaded_depth", "with_shaded_depth"]

_SMOOTH_TANGENT = 2.5 / 575.8
"""Standard deviation of the smoothing by the focal length: 2.5 pixels of a Kinect v1, which takes
most of the noise out of the slopes and leaves eye sockets, nose and mouth."""
_LIGHT = (0.0, -0.6, -1.0)
"""Where the light comes from: the camera and above, as on most photographs, so that eye sockets
are dark as the cascades expect them."""
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
    focal = camera.fx * depth.shape[1] / camera.width
    sigma = max(focal * _SMOOTH_TANGENT, 0.8)
    measured = (depth > 0).astype(np.float32)
    weight = cv2.GaussianBlur(measured, (0, 0), sigma)
    # Normalized convolution: what is missing pulls no slope to zero.
    z = cv2.GaussianBlur(depth * np.float32(unit_mm), (0, 0), sigma) / np.maximum(weight, 1e-6)
    pixel_mm = np.maximum(z, 1.0) / np.float32(focal)
    dz_dx = cv2.Sobel(z, cv2.CV_32F, 1, 0, scale=1 / 8) / pixel_mm
    dz_dy = cv2.Sobel(z, cv2.CV_32F, 0, 1, scale=1 / 8) / pixel_mm
    x, y, back = np.array(_LIGHT, np.float32) / np.linalg.norm(_LIGHT)
    # The normal toward the camera is (dz/dx, dz/dy, -1).
    cosine = (dz_dx * x + dz_dy * y - back) / np.sqrt(1 + dz_dx * dz_dx + dz_dy * dz_dy)
    shade: Bytes = (np.clip(cosine, 0, 1) * 255).astype(np.uint8)
    shade[weight < _LEAST_MEASURED] = 0
    return shade


def with_shaded_depth(frame: RgbdFrame) -> RgbdFrame:
    """Give a frame without colour its shaded depth in place of it; another one as it is."""
    if frame.color is not None:
        return frame
    camera = frame.depth_camera
    shade = shaded_depth(frame.depth, camera, frame.depth_meaning.unit_um / 1000)
    return replace(frame, color=np.repeat(shade[..., None], 3, axis=2), registered=True,
                   calibration=Calibration(depth=camera, color=camera))
