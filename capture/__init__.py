"""Frames and where they come from."""

from denseface.capture.errors import CaptureError
from denseface.capture.frame import Calibration, CameraModel, DepthToColor, RgbdFrame
from denseface.capture.source import Source, open_source

__all__ = ["Calibration", "CameraModel", "CaptureError", "DepthToColor", "RgbdFrame", "Source",
           "open_source"]
