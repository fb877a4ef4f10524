"""Frames and where they come from."""

from capture.errors import CaptureError
from capture.frame import Calibration, CameraModel, DepthToColor, RgbdFrame
from capture.source import Source, open_source

__all__ = ["Calibration", "CameraModel", "CaptureError", "DepthToColor", "RgbdFrame", "Source",
           "open_source"]
