"""Frames and where they come from."""

from capture.errors import CaptureError
from capture.frame import Calibration, CameraModel, DepthToColor, RgbdFrame

__all__ = ["Calibration", "CameraModel", "CaptureError", "DepthToColor", "RgbdFrame"]
