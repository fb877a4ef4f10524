import json

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from denseface.capture.calibration import (
    Calibration,
    CameraModel,
    DepthToColor,
    _RayMaps,
    _rays,
)
from denseface.capture.calibration_files import read_calibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import CalibrationError
from tests.unit.frames import calibration, camera, cameras, poses


@settings(deadline=None)
@given(cam=cameras(), z=st.floats(300, 4000), seed=st.integers(0, 999))
def test_projection_undoes_back_projection(cam, z, seed):
    rng = np.random.default_rng(seed)
    pixels = rng.uniform((0, 0), (cam.width - 1, cam.height - 1), (50, 2))
    points = cam.back_project(pixels, z)
    np.testing.assert_allclose(points[:, 2], z)
    np.testing.assert_allclose(cam.project(points), pixels, atol=1e-6)


@settings(deadline=None)
@given(cam=cameras(), seed=st.integers(0, 999))
def test_projection_is_that_of_opencv(cam, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform((-300, -200, 500), (300, 200, 2000), (20, 3))
    K = np.array([[cam.fx, 0, cam.cx], [0, cam.fy, cam.cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(cam.distortion))
    np.testing.assert_allclose(cam.project(points), expected[:, 0], atol=1e-6)


def test_back_projection_is_equation_1():
    cam = camera(fx=150.0, fy=140.0, cx=80.0, cy=60.0)
    x, y, z = cam.back_project(np.array([110.0, 88.0]), 700.0)
    assert (x / (110 - 80), y / (88 - 60)) == pytest.approx((z / 150, z / 140))


def test_rays_are_every_pixels_own():
    cam = camera(distortion=(0.1, -0.05, 0.001, -0.002, 0.01))
    rays = cam.rays()
    assert rays.shape == (120, 160, 2)
    assert not rays.flags.writeable
    np.testing.assert_allclose(
        cam.project(np.array([*rays[7, 130], 1.0])), (130, 7), atol=1e-8)


def test_the_maps_of_rays_that_are_kept_have_a_limit():
    cams = [camera(cx=float(cx), distortion=(0.01, 0, 0, 0, 0)) for cx in range(70, 80)]
    size = cams[0].rays().nbytes
    maps = _RayMaps(3 * size)
    rays = {cam: maps.of(cam) for cam in cams}
    assert maps.nbytes == 3 * size
    assert maps.of(cams[-1]) is rays[cams[-1]]
    assert maps.of(cams[0]) is not rays[cams[0]]
    none = _RayMaps(size - 1)
    np.testing.assert_array_equal(none.of(cams[3]), rays[cams[3]])
    assert none.nbytes == 0


def test_rays_are_the_same_however_many_are_computed_at_once(monkeypatch):
    cam = camera(distortion=(0.1, -0.05, 0.001, -0.002, 0.01))
    whole = _rays(cam)
    monkeypatch.setattr("denseface.capture.calibration._RAYS_AT_ONCE", 1000)
    np.testing.assert_allclose(_rays(cam), whole, rtol=0, atol=1e-11)


@settings(deadline=None)
@given(cam=cameras(), factor=st.sampled_from([0.5, 2.0, 3.0]))
def test_scaled_camera_sees_the_same_rays(cam, factor):
    point = np.array([[30.0, -20.0, 900.0]])
    expected = (cam.project(point) + 0.5) * factor - 0.5
    np.testing.assert_allclose(cam.scaled(factor).project(point), expected, atol=1e-6)


@settings(deadline=None)
@given(depth=cameras(), color=cameras(), pose=poses())
def test_calibration_json_round_trip(depth, color, pose):
    calib = Calibration(depth=depth, color=color, depth_to_color=pose)
    assert Calibration.from_json(calib.to_json()) == calib


def test_calibration_json_is_the_documented_one():
    loaded = json.loads(calibration().to_json())
    assert set(loaded) == {"depth", "color", "depth_to_color"}
    assert set(loaded["depth"]) == {"width", "height", "fx", "fy", "cx", "cy", "distortion"}
    assert set(loaded["depth_to_color"]) == {"rotation", "translation_mm"}


def test_transform_is_rotation_then_translation():
    quarter = DepthToColor(rotation=((0, -1, 0), (1, 0, 0), (0, 0, 1)), translation_mm=(1, 2, 3))
    np.testing.assert_allclose(quarter.apply(np.array([10.0, 0, 0])), (1, 12, 3))


def _broken(path: str, value: object) -> str:
    loaded = json.loads(calibration().to_json())
    *parents, last = path.split(".")
    place = loaded
    for key in parents:
        place = place[key]
    place[last] = value
    return json.dumps(loaded)


@pytest.mark.parametrize(("path", "value"), [
    ("depth.fx", 0), ("depth.fx", -1.0), ("color.width", 0), ("color.height", 10**9),
    ("depth.cx", "left"), ("depth.distortion", [0, 0]), ("depth.lens", 1),
    ("depth_to_color.rotation", [[1, 0, 0], [0, 1, 0], [0, 0, -1]]),
    ("depth_to_color.rotation", [[2, 0, 0], [0, 1, 0], [0, 0, 1]]),
    ("depth_to_color.translation_mm", [0, 0]), ("depth_to_color.translation_mm", [0, 1e5, 0]),
])
def test_bad_calibration_is_named_in_one_line(path, value):
    with pytest.raises(CalibrationError) as caught:
        Calibration.from_json(_broken(path, value), name="x.calibration.json")
    assert str(caught.value).startswith(f"x.calibration.json: {path}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("path", "value"), [
    ("depth.fx", 1e9), ("color.fy", 1e-300), ("color.cx", 1e300), ("depth.cy", -1e9),
    ("depth.fx", 1600.0)])
def test_a_camera_that_cannot_be_is_named_in_one_line(path, value):
    with pytest.raises(CalibrationError) as caught:
        Calibration.from_json(_broken(path, value), name="x.calibration.json")
    where, name = path.split(".")
    assert str(caught.value).startswith(f"x.calibration.json: {where}: {name} is ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "NaN", b"\xff\xfe"])
def test_bad_json_is_a_calibration_error(text):
    with pytest.raises(CalibrationError, match=r"x\.json"):
        Calibration.from_json(text, name="x.json")


def test_missing_calibration_file(tmp_path):
    with pytest.raises(CalibrationError, match=r"nowhere\.json: No such file"):
        read_calibration(tmp_path / "nowhere.json")


@pytest.mark.parametrize("bad", [{"fx": float("nan")}, {"cy": float("inf")}, {"width": 2.5}])
def test_camera_refuses_what_is_no_number(bad):
    with pytest.raises(CalibrationError, match=rf"^{next(iter(bad))}: expected a"):
        camera(**bad)


def test_a_distortion_that_folds_the_image_is_refused():
    with pytest.raises(CalibrationError, match="cannot be inverted"):
        camera(distortion=(-2.0, 0, 0, 0, 0))


def test_models_are_frozen():
    with pytest.raises(ValidationError):
        camera().fx = 1.0
    assert isinstance(hash(camera()), int)


def test_camera_model_refuses_wrong_shapes():
    with pytest.raises(ValueError, match="points"):
        camera().project(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="pixels"):
        CameraModel.back_project(camera(), np.zeros((3, 3)), 1.0)


VGA = CameraModel(width=640, height=480, fx=575.8, fy=574.0, cx=321.0, cy=243.0)


@pytest.mark.parametrize(("size", "focal", "center"), [
    ((640, 480), 575.8, (321, 243)), ((320, 240), 287.9, (160.25, 121.25)),
    ((640, 400), 575.8, (321, 203)), ((1280, 960), 1151.6, (642.5, 486.5)),
    ((1280, 1024), 1151.6, (642.5, 486.5)), ((640, 512), 575.8, (321, 243)),
    ((640, 360), 575.8, (321, 183)), ((1280, 800), 1151.6, (642.5, 406.5))])
def test_a_camera_in_another_mode(size, focal, center):
    cut = VGA.cut_to(*size)
    assert (cut.width, cut.height) == size
    assert cut.fx == pytest.approx(focal)
    assert (cut.cx, cut.cy) == pytest.approx(center)
    back = cut.cut_to(640, 480)
    assert (back.fx, back.fy, back.cx, back.cy) == pytest.approx((575.8, 574, 321, 243))


def test_a_mode_that_no_sensor_has():
    with pytest.raises(ValueError, match="480x640 is no known cut of a sensor's image"):
        VGA.cut_to(480, 640)


def test_a_camera_for_images_of_another_resolution():
    cam = camera()
    double = cam.for_size(cam.width * 2, cam.height * 2)
    point = np.array([40.0, -30.0, 700.0])
    np.testing.assert_allclose((double.project(point) + 0.5) / 2 - 0.5, cam.project(point))
    assert cam.for_size(cam.width, cam.height) is cam
    assert double.for_size(cam.width, cam.height) == cam


@pytest.mark.parametrize("size", [(640, 400), (1280, 1024), (480, 640), (848, 480)])
def test_an_image_of_another_shape_shows_something_else(size):
    cam = CameraModel(width=1920, height=1080, fx=1081, fy=1081, cx=959.5, cy=539.5)
    with pytest.raises(CalibrationError, match=f"of 1920x1080, the image is {size[0]}x{size[1]}"):
        cam.for_size(*size)


def test_vga_is_the_upper_part_of_1280x1024():
    vga = CameraModel(width=640, height=480, fx=525, fy=525, cx=319.5, cy=239.5)
    large = vga.for_size(1280, 1024)
    assert (large.width, large.height, large.fx, large.cx, large.cy) == (1280, 1024, 1050, 639.5,
                                                                         479.5)
    assert large.for_size(640, 480) == vga


def test_cameras_are_fitted_to_a_depth_registered_at_another_resolution():
    calib = calibration()
    width, height = calib.color.width, calib.color.height
    same, registered = calib.for_images((width, height), (width, height), registered=True)
    assert (same, registered) == (calib, True)
    half, registered = calib.for_images((width // 2, height // 2), (width, height), registered=True)
    assert not registered
    assert half.color == calib.color
    assert half.depth == calib.color.for_size(width // 2, height // 2)
    assert half.depth_to_color == DepthToColor()
    assert doubts_of(half) == ()
