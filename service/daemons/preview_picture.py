"""The picture of a preview: what the colour camera sees, or the depth shaded as a relief."""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture import RgbdFrame
from denseface.service.protocol.payload import MAX_JPEG_BYTES, MAX_PREVIEW_SIDE

__all__ = ["preview_jpeg"]

_QUALITIES = 85, 60, 30
"""Quality of the JPEG; the next where a picture of noise has more than `MAX_JPEG_BYTES`."""
_RELIEF_SIDE = 320
"""Longest side of a relief, pixels."""


def preview_jpeg(frame: RgbdFrame) -> bytes:
    """Give a frame's picture as a JPEG, no side above `MAX_PREVIEW_SIDE`.

    In colour where the frame has it, else its depth as a grey relief, without readings black.
    """
    image = _relief(frame) if frame.color is None else _shrunk(frame.color)
    if image.ndim == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), np.uint8)
    for quality in _QUALITIES:
        data: bytes = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, quality))[1].tobytes()
        if len(data) <= MAX_JPEG_BYTES:
            break
    return data


def _shrunk(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Shrink an image by a whole factor, where it is too large: means of areas."""
    height, width = image.shape[:2]
    factor = -(-max(height, width) // MAX_PREVIEW_SIDE)
    if factor == 1:
        return image
    size = max(width // factor, 1), max(height // factor, 1)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _relief(frame: RgbdFrame) -> NDArray[np.uint8]:
    """Shade the depth, thinned out: the smoothing within takes most of the time."""
    from denseface.recon.registration import shaded_depth  # with the kernels beside it

    step = -(-max(frame.depth.shape) // _RELIEF_SIDE)
    unit_mm = frame.depth_meaning.unit_um / 1000
    return shaded_depth(frame.depth[::step, ::step], frame.depth_camera, unit_mm)
