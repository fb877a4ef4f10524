import numpy as np
import pytest

from denseface.capture.calibration import DepthToColor
from denseface.capture.errors import FrameError
from denseface.capture.frame import RgbdFrame
from tests.unit.frames import calibration, camera, frame

DEPTH, COLOR = np.zeros((120, 160), np.uint16), np.zeros((120, 160, 3), np.uint8)


def test_frame_knows_its_skew():
    assert frame(DEPTH, COLOR).skew_us == -1000


def test_registered_depth_is_in_the_colour_cameras_pixels():
    calib = calibration(color=camera(200, 150))
    registered = frame(np.zeros((150, 200), np.uint16), np.zeros((150, 200, 3), np.uint8), calib,
                       registered=True)
    assert registered.depth_camera == calib.color
    assert registered.depth_to_color == DepthToColor()


def test_registered_depth_of_another_mode_than_the_colour_image():
    """640x480 is the upper part of 1280x1024, at half its size."""
    color = camera(1280, 1024, f=1050.0).model_copy(update={"cx": 641.0, "cy": 487.0})
    registered = frame(np.zeros((480, 640), np.uint16), np.zeros((1024, 1280, 3), np.uint8),
                       calibration(color=color), registered=True)
    small = registered.depth_camera
    assert (small.width, small.height, small.fx) == (640, 480, 525)
    assert (small.cx, small.cy) == (320.25, 243.25)
    with pytest.raises(FrameError, match="depth is 160x400, its calibration says 1280x1024"):
        frame(np.zeros((400, 160), np.uint16), np.zeros((1024, 1280, 3), np.uint8),
              calibration(color=color), registered=True)


@pytest.mark.parametrize(("depth", "color", "match"), [
    (DEPTH.astype(np.float32), COLOR, "depth must be a 2-dimensional uint16.*float32"),
    (DEPTH[0], COLOR, "depth must be a 2-dimensional"),
    (DEPTH[:50], COLOR, "depth is 160x50, its calibration says 160x120"),
    (DEPTH, COLOR[..., 0], "color must be a 3-dimensional"),
    (DEPTH, COLOR[:, :80], "color is 80x120"),
    (DEPTH, np.zeros((120, 160, 4), np.uint8), "3 channels"),
    (DEPTH, COLOR.astype(np.int16), "uint8"),
    (None, COLOR, "NoneType"),
])
def test_frame_refuses_wrong_arrays(depth, color, match):
    with pytest.raises(FrameError, match=match):
        RgbdFrame(depth, color, 0, 0, calibration())


def test_frame_under_another_calibration():
    other = calibration(depth=camera(f=170.0))
    changed = frame(DEPTH, COLOR).with_calibration(other, "argument a.json")
    assert (changed.calibration, changed.calibration_origin) == (other, "argument a.json")
