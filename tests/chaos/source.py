"""A small frame with a real face, so that a press takes milliseconds."""

from pathlib import Path

import cv2
import numpy as np

from denseface.capture import RgbdFrame, open_source
from denseface.capture.calibration import Calibration
from denseface.capture.npz import save_frame

__all__ = ["CHEAP", "write_small_frame"]

CHEAP = ("--set", "ratio=1.5")
"""Settings that make a face of it cheaper still."""

_RECORDING = (Path(__file__).resolve().parents[2] / "fixtures" / "recorded_oni"
              / "frontal_700.oni")
_DEPTH_SHRINK, _COLOR_SHRINK = 4, 2.5


def write_small_frame(path: Path) -> None:
    """Write the first frame of a bundled recording at 160 x 120 depth pixels as `.npz`."""
    with open_source(str(_RECORDING)) as source:
        frame = next(iter(source))
    depth = np.ascontiguousarray(frame.depth[::_DEPTH_SHRINK, ::_DEPTH_SHRINK])
    color = cv2.resize(frame.rgb, None, fx=1 / _COLOR_SHRINK, fy=1 / _COLOR_SHRINK,
                       interpolation=cv2.INTER_AREA)
    calibration = Calibration(
        depth=frame.calibration.depth.scaled(1 / _DEPTH_SHRINK),
        color=frame.calibration.color.scaled(1 / _COLOR_SHRINK),
        depth_to_color=frame.calibration.depth_to_color)
    save_frame(RgbdFrame(
        depth, color.astype(np.uint8), frame.depth_timestamp_us, frame.color_timestamp_us,
        calibration), path)
