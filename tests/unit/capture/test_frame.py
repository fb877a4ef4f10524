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


@pytest.mark.parametrize(("depth", "color", "match"), [
    (DEPTH.astype(np.float32), COLOR, r"depth must be a \(H, W\) uint16 array.*float32.*metres"),
    (DEPTH[0], COLOR, r"depth must be a \(H, W\) uint16 array, found ndarray of uint16 \(160,\)$"),
    (DEPTH[..., None], COLOR, r"found ndarray of uint16 \(120, 160, 1\): depth\[..., 0\] is one"),
    (DEPTH.astype(np.int32), COLOR, r"int32 .*: of millimetres depth.astype\(np.uint16\)"),
    (DEPTH.tolist(), COLOR, "depth must be .*, found list: np.asarray makes one"),
    (DEPTH[:50], COLOR, "depth is 160x50, its calibration says 160x120"),
    (DEPTH, COLOR[..., 0], r"color must be a \(H, W, 3\) uint8 array, RGB, .*shades of grey"),
    (DEPTH, COLOR[:, :80], "color is 80x120"),
    (DEPTH, np.zeros((120, 160, 4), np.uint8), r"found .* 4\): color\[..., :3\] leaves out"),
    (DEPTH, np.zeros((3, 120, 160), np.uint8), "puts the channels last"),
    (DEPTH, COLOR / 255, "found ndarray of float64 .*255"),
    (DEPTH, COLOR.astype(np.int16), "uint8"),
    (DEPTH, COLOR.tolist(), "color must be .*, found list: np.asarray makes one"),
    (None, COLOR, "depth must be .*, found None$"),
    (COLOR, DEPTH, r"depth must be .*, found ndarray of uint8 \(120, 160, 3\)$"),
])
def test_frame_refuses_wrong_arrays(depth, color, match):
    with pytest.raises(FrameError, match=match):
        RgbdFrame(depth, color, 0, 0, calibration())


def test_frame_under_another_calibration():
    other = calibration(depth=camera(f=170.0))
    changed = frame(DEPTH, COLOR).with_calibration(other, "argument a.json")
    assert (changed.calibration, changed.calibration_origin) == (other, "argument a.json")
