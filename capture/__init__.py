"""Frames and where they come from."""

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.errors import CaptureError
from denseface.capture.frame import (
    MAX_BURST,
    DepthMeaning,
    DepthRounding,
    FrameOrigin,
    RgbdFrame,
)
from denseface.capture.source import Source, open_source

__all__ = ["MAX_BURST", "Calibration", "CameraModel", "CaptureError", "DepthMeaning",
           "DepthRounding", "DepthToColor", "FrameOrigin", "RgbdFrame", "Source", "open_source"]
