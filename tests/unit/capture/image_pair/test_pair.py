"""Frames of two image files: what is known, what is assumed and said."""

import numpy as np
import pytest

from denseface.capture import Calibration, CameraModel, DepthToColor
from denseface.capture.agreement import Agreement, Verdict
from denseface.capture.calibration import ChosenCalibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import CalibrationError, FrameError
from denseface.capture.image_pair import ImagePairSource, PairReading
from denseface.capture.image_pair._defaults import default_calibration
from tests.unit.capture.image_pair.files import COLOR, DEPTH, write

DEPTH_CAMERA = CameraModel(width=64, height=48, fx=57, fy=57, cx=31.5, cy=23.5)
COLOR_CAMERA = CameraModel(width=64, height=48, fx=52, fy=52, cx=31.5, cy=23.5)
POSE = DepthToColor(translation_mm=(-23, 0, 0))
BOTH = Calibration(depth=DEPTH_CAMERA, color=COLOR_CAMERA, depth_to_color=POSE)
ONE = Calibration(depth=COLOR_CAMERA, color=COLOR_CAMERA)


@pytest.fixture
def paths(tmp_path):
    return write(tmp_path / "d.png", DEPTH), write(tmp_path / "c.png", COLOR)


def frame_of(depth, color=None, chosen=None, **reading):
    chosen = chosen and ChosenCalibration(chosen, "mine")
    with ImagePairSource(depth, color, PairReading(chosen=chosen, **reading)) as source:
        frame, = source
        assert source.frame_count == 1
        return frame


def test_with_everything_said_nothing_is_noted(paths):
    frame = frame_of(*paths, BOTH, unit_mm=1.0, registered=False)
    np.testing.assert_array_equal(frame.depth, DEPTH)
    np.testing.assert_array_equal(frame.color, COLOR)
    assert (frame.calibration, frame.calibration_origin, frame.registered) == (BOTH, "mine", False)
    assert frame.origin.notes == ()


def test_what_was_assumed_is_noted(paths):
    frame = frame_of(*paths)
    unit, registered, cameras = frame.origin.notes
    assert "1 is taken for 1 mm" in unit
    assert "taken to be registered" in registered
    assert "no calibration was given" in cameras
    assert frame.registered


def test_two_cameras_and_a_pose_say_that_the_depth_is_not_registered(paths):
    frame = frame_of(*paths, BOTH, unit_mm=1.0)
    assert not frame.registered
    assert frame.origin.notes == ("the depth is taken to be not registered to the colour: the "
                                  "calibration has two cameras and a pose (--registered says)",)


def test_a_depth_alone_is_a_frame(paths):
    frame = frame_of(paths[0], chosen=BOTH, unit_mm=1.0)
    assert frame.color is None
    assert frame.depth_camera == DEPTH_CAMERA
    assert frame.origin.notes == ()


def test_cameras_are_fitted_to_the_images_resolution(tmp_path, paths):
    large = write(tmp_path / "l.png", np.kron(COLOR, np.ones((2, 2, 1), np.uint8)))
    frame = frame_of(paths[0], large, BOTH, unit_mm=1.0)
    color = frame.calibration.color
    assert (color.width, color.fx, color.cx) == (128, 104, 63.5)
    assert frame.calibration.depth == DEPTH_CAMERA
    assert frame.depth_to_color == POSE


def test_registered_at_another_resolution_is_the_same_camera_in_fewer_pixels(tmp_path, paths):
    large = write(tmp_path / "l.png", np.kron(COLOR, np.ones((2, 2, 1), np.uint8)))
    frame = frame_of(paths[0], large, ONE, unit_mm=1.0, registered=True)
    assert frame.depth_camera == COLOR_CAMERA
    assert frame.calibration.color.fx == 104
    point = np.array([10.0, -20.0, 700.0])
    u, v = frame.calibration.color.project(frame.depth_to_color.apply(point))
    np.testing.assert_allclose((np.array([u, v]) + 0.5) / 2 - 0.5, COLOR_CAMERA.project(point))


def test_an_image_of_another_shape_is_refused(tmp_path, paths):
    wide = write(tmp_path / "w.png", COLOR[:36])
    with pytest.raises(CalibrationError, match=r"d\.png: the color camera's calibration is for "
                       r"images of 64x48, the image is 64x36.*\(calibration: mine\)"):
        frame_of(paths[0], wide, BOTH, unit_mm=1.0)


def test_one_camera_is_not_enough_for_a_depth_that_is_not_registered(paths):
    with pytest.raises(CalibrationError, match="mine: describes one camera, but the depth"):
        frame_of(*paths, ONE, unit_mm=1.0, registered=False)
    assert frame_of(*paths, ONE, unit_mm=1.0).registered


def test_a_pose_that_is_missing_or_in_metres_is_noted(paths):
    missing = Calibration(depth=DEPTH_CAMERA, color=COLOR_CAMERA)
    metres = BOTH.model_copy(update={"depth_to_color": DepthToColor(
        translation_mm=(-0.023, 0, 0))})
    note, = frame_of(*paths, missing, unit_mm=1.0, registered=False).origin.notes
    assert "no pose between its cameras" in note
    note, = frame_of(*paths, metres, unit_mm=1.0, registered=False).origin.notes
    assert "0.023 mm apart" in note
    assert "metres in place of millimetres?" in note
    assert frame_of(*paths, missing, unit_mm=1.0, registered=True).origin.notes == ()


def test_a_unit_that_is_not_clear_names_the_file(tmp_path):
    path = write(tmp_path / "d.png", (DEPTH * 5).astype(np.uint16))
    with pytest.raises(FrameError, match=r"d\.png: its readings are .* --unit mm, 0\.2mm"):
        frame_of(path)
    assert frame_of(path, unit_mm=0.2).depth_meaning.unit_um == 1000


@pytest.mark.parametrize(("depth", "color", "name", "focal"), [
    ((512, 424), (1920, 1080), "Kinect v2", (365.5, 1081.4)),
    ((640, 576), (1280, 720), "Azure Kinect", (504, 604)),
    ((848, 480), (1920, 1080), "RealSense", (425, 1377)),
    ((640, 400), (640, 480), "Orbbec", (575, 525)),
    ((640, 480), (1280, 1024), "Kinect v1", (575.8, 1050)),
])
def test_sensors_are_known_by_the_sizes_of_their_images(depth, color, name, focal):
    calibration, words = default_calibration(depth, color, registered=False)
    assert name in words
    assert (calibration.depth.fx, calibration.color.fx) == focal
    assert doubts_of(calibration) == ()
    assert (calibration.depth.width, calibration.color.height) == (depth[0], color[1])


@pytest.mark.parametrize("size", [(640, 480), (848, 480), (512, 424), (1280, 1024), (100, 80)])
def test_one_camera_is_known_by_its_image_too(size):
    for registered, color in ((True, size), (False, None)):
        calibration, words = default_calibration(size, color, registered)
        assert (calibration.color.width, calibration.color.height) == size
        assert 50 < np.degrees(2 * np.arctan(size[0] / 2 / calibration.color.fx)) < 92
        assert "focal length" in words


def test_a_pair_that_may_not_be_registered_has_the_depth_camera_too():
    """What is measured then can say so."""
    calibration, words = default_calibration((640, 480), (640, 480), registered=True)
    assert (calibration.depth.fx, calibration.color.fx) == (575.8, 525)
    assert calibration.depth_to_color.translation_mm == (-23, 0, 0)
    assert "focal length 525" in words


def test_a_guess_that_was_measured_is_not_told(paths):
    guessed = ImagePairSource(*paths, PairReading(1.0, chosen=ChosenCalibration(ONE, "mine")))
    note, = next(iter(guessed)).origin.notes
    assert "taken to be registered" in note
    guessed._preparation._found = Agreement(Verdict.AGREES)
    assert next(iter(guessed)).origin.notes == ()


def test_the_default_of_1280x1024_is_that_of_vga_with_more_rows_below():
    camera = default_calibration((640, 480), (1280, 1024), registered=False).calibration.color
    assert camera.cy == 479.5
    vga = CameraModel(width=640, height=480, fx=525, fy=525, cx=319.5, cy=239.5)
    assert vga.for_size(1280, 1024) == camera
    assert camera.for_size(640, 480) == vga
