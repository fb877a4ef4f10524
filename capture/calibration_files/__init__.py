"""Calibration files: the project's own JSON, OpenCV's and ROS's YAML and XML, Open3D's JSON."""

from denseface.capture.calibration_files._choose import (
    choose_calibration,
    load_calibration,
    read_calibration,
)

__all__ = ["choose_calibration", "load_calibration", "read_calibration"]
