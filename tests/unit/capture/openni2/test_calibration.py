import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.openni2._calibration import SensorProperties, derive_calibration, fit
from denseface.capture.openni2._orbbec import unpack

VGA = (640, 480)
KINECT_BY_FREENECT = SensorProperties(
    zpd_mm=120, zpps_mm=0.10520000010728836, depth_fov=math.radians(58.5),
    color_fov=math.radians(62), uri="freenect://0")


def test_a_kinect_v1():
    calibration, derivation = derive_calibration(SensorProperties(
        zpd_mm=120, zpps_mm=0.10419999808073044, dcrcdis_cm=2.299999952316284), VGA, VGA)
    depth, color = calibration.depth, calibration.color
    assert depth.fx == depth.fy == pytest.approx(575.8, abs=0.05)
    assert (depth.cx, depth.cy) == (color.cx, color.cy) == (319.5, 239.5)
    assert color.fx == color.fy == 525
    assert calibration.depth_to_color.translation_mm == pytest.approx((-23, 0, 0))
    assert calibration.depth_to_color.rotation == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert derivation == "ZPD 120, ZPPS 0.1042, DCRCDIS 2.3"


@given(st.integers(100, 140), st.floats(0.09, 0.12), st.sampled_from([(320, 240), VGA,
                                                                     (1280, 1024)]))
@settings(deadline=None)
def test_the_focal_length_scales_with_the_width(zpd, zpps, size):
    calibration, _ = derive_calibration(
        SensorProperties(zpd_mm=zpd, zpps_mm=zpps, dcrcdis_cm=2.3), size, size)
    assert calibration.depth.fx == pytest.approx(zpd / zpps * size[0] / 1280)
    assert calibration.depth.cx == (size[0] - 1) / 2
    assert calibration.color.fx == pytest.approx(525 * size[0] / 640)


def test_field_of_view_where_nothing_better_is_known():
    fov = 2 * math.atan(320 / 580)
    calibration, derivation = derive_calibration(
        SensorProperties(depth_fov=fov, color_fov=2 * math.atan(320 / 530)), VGA, VGA)
    assert calibration.depth.fx == pytest.approx(580)
    assert calibration.color.fx == pytest.approx(530)
    assert "depth field of view" in derivation
    assert "default DCRCDIS" in derivation


@pytest.mark.parametrize(("vendor", "focal", "kind"), [(0, 575.8, "Kinect v1"),
                                                       (0x045E, 575.8, "Kinect v1"),
                                                       (0x1D27, 570.3, "Xtion")])
def test_defaults_of_the_kind(vendor, focal, kind):
    calibration, derivation = derive_calibration(SensorProperties(usb_vendor=vendor), VGA, VGA)
    assert calibration.depth.fx == focal
    assert kind in derivation


@pytest.mark.parametrize("nonsense", [0, -1, math.nan, math.inf])
def test_nonsense_falls_back(nonsense):
    calibration, _ = derive_calibration(SensorProperties(
        zpd_mm=120, zpps_mm=nonsense, dcrcdis_cm=nonsense, depth_fov=nonsense,
        color_fov=nonsense), VGA, VGA)
    assert calibration.depth.fx == 575.8
    assert calibration.color.fx == 525
    assert calibration.depth_to_color.translation_mm == (-23, 0, 0)


def test_freenects_constants_are_not_the_kinects():
    calibration, derivation = derive_calibration(KINECT_BY_FREENECT, VGA, VGA)
    assert (calibration.depth.fx, calibration.color.fx) == (575.8, 525)
    assert derivation == ("Freenect's driver gives constants of another sensor, "
                          "default depth f 575.8 (Kinect v1), default DCRCDIS 2.3")


def test_freenects_constants_in_a_recording():
    recorded = replace(KINECT_BY_FREENECT, uri="", depth_fov=None, color_fov=None)
    assert derive_calibration(recorded, VGA, VGA)[0].depth.fx == 575.8
    xtion = replace(recorded, dcrcdis_cm=2.3)
    assert derive_calibration(xtion, VGA, VGA)[0].depth.fx == pytest.approx(570.3, abs=0.05)


def test_an_xtion_says_the_same_and_is_believed():
    xtion = replace(KINECT_BY_FREENECT, uri="1d27/0601@1/5", usb_vendor=0x1D27)
    calibration, _ = derive_calibration(xtion, VGA, VGA)
    assert calibration.depth.fx == pytest.approx(570.3, abs=0.05)
    assert calibration.color.fx == pytest.approx(532.6, abs=0.05)


@pytest.mark.parametrize(("size", "center"), [
    (VGA, (319.5, 239.5)), ((320, 240), (159.5, 119.5)), ((640, 400), (319.5, 199.5)),
    ((1280, 1024), (639.5, 479.5)), ((1280, 960), (639.5, 479.5)),
    ((1280, 720), (639.5, 359.5)), ((480, 640), (239.5, 319.5))])
def test_where_the_center_of_a_mode_is(size, center):
    calibration, _ = derive_calibration(SensorProperties(), VGA, size)
    assert (calibration.color.cx, calibration.color.cy) == center
    assert calibration.color.fx == calibration.color.fy == 525 * size[0] / 640


def test_a_sensor_without_a_color_camera():
    calibration, derivation = derive_calibration(
        SensorProperties(depth_fov=2 * math.atan(160 / 288)), (320, 240), None)
    assert calibration.color == calibration.depth
    assert calibration.depth.fx == pytest.approx(288)
    assert calibration.depth_to_color.translation_mm == (0, 0, 0)
    assert "DCRCDIS" not in derivation


def test_a_calibration_of_ones_own_for_other_modes():
    mine, _ = derive_calibration(SensorProperties(), VGA, VGA)
    chosen = ChosenCalibration(mine, "argument mine.json")
    assert fit(chosen, VGA, VGA) is chosen
    calibration, origin, *_ = fit(chosen, (320, 240), (1280, 1024))
    assert (calibration, origin) == (
        derive_calibration(SensorProperties(), (320, 240), (1280, 1024))[0],
        "argument mine.json, depth cut to 320x240, color cut to 1280x1024")
    assert fit(chosen, (320, 240), None).calibration.color == mine.color
    assert fit(chosen, (480, 640), None) is chosen


R = np.array([[0.99998, -0.00265, 0.00527], [0.00264, 1, 0.0006], [-0.00527, -0.00059, 0.99999]])
ORBBEC = (577.2, 576.6, 318.6, 243.7, 525.4, 526.6, 326.2, 238.4, *R.ravel(),
          -25.1, -0.44, -0.58,
          -0.08, 0.21, -0.13, 0.0012, -0.0021,
          0.03, -0.06, 0.02, -0.001, 0.002)


def orbbec(**changed):
    values = list(ORBBEC)
    for at, value in changed.items():
        values[int(at[1:])] = value
    return tuple(values)


def test_an_orbbecs_factory_calibration():
    assert unpack(struct.pack("<30fi", *ORBBEC, 2)) == pytest.approx(ORBBEC)
    assert unpack(struct.pack("<29f", *ORBBEC[:29])) is None
    calibration, derivation = derive_calibration(SensorProperties(orbbec=ORBBEC), VGA, VGA)
    depth, color, pose = calibration.depth, calibration.color, calibration.depth_to_color
    assert derivation == "Orbbec factory calibration"
    assert (depth.fx, depth.fy, depth.cx, depth.cy) == ORBBEC[:4]
    assert (color.fx, color.fy, color.cx, color.cy) == ORBBEC[4:8]
    assert depth.distortion == (-0.08, 0.21, 0.0012, -0.0021, -0.13)
    assert color.distortion == (0.03, -0.06, -0.001, 0.002, 0.02)
    assert pose.translation_mm == ORBBEC[17:20]
    np.testing.assert_allclose(pose.rotation, R, atol=1e-4)


def test_an_orbbecs_other_modes():
    calibration, _ = derive_calibration(SensorProperties(orbbec=ORBBEC), (640, 400), (1280, 960))
    assert calibration.depth.cy == pytest.approx(243.7 - 40)
    assert calibration.color.fx == pytest.approx(2 * 525.4)
    # One whose center says that it is for 400 rows already.
    flat = derive_calibration(SensorProperties(orbbec=orbbec(_3=201.0)), (640, 400), VGA)[0]
    assert flat.depth.cy == 201.0
    alone, _ = derive_calibration(SensorProperties(orbbec=ORBBEC), (320, 240), None)
    assert alone.depth.fx == alone.color.fx == 577.2 / 2


@pytest.mark.parametrize(("wrong", "why"), [
    (orbbec(_0=math.nan), "depth camera has no numbers"),
    (orbbec(_24=math.inf), "depth camera has no numbers"),
    ((0.0,) * 30, "depth camera has f 0 for 640 columns"),
    (orbbec(_4=5254.0), "color camera has f 5254 for 640 columns"),
    (orbbec(_5=700.0), "color camera has fx 525.4 and fy 700"),
    (orbbec(_2=640.0), "depth camera has its center at 640, 243.7"),
    (orbbec(_27=0.6, _28=0.6), "color camera has a distortion p1 0.6"),
    (orbbec(_25=-1.5), "distortion cannot be inverted"),
    (orbbec(_8=math.nan), "the cameras' pose has no numbers"),
    (orbbec(_8=0.7), "the cameras' pose is no rotation"),
    (orbbec(_8=-1.0, _12=-1.0, _9=0.0, _10=0.0, _11=0.0, _13=0.0, _14=0.0, _15=0.0, _16=1.0),
     "the cameras are turned by 180.0 degrees"),
    (orbbec(_17=-0.0251, _18=0.0, _19=0.0), "the cameras are 0.0251 mm apart"),
    (orbbec(_17=-251.0), "the cameras are 251 mm apart"),
])
def test_an_orbbecs_calibration_that_cannot_be(wrong, why):
    calibration, derivation = derive_calibration(
        SensorProperties(orbbec=wrong, usb_vendor=0x2BC5, depth_fov=2 * math.atan(320 / 580)),
        VGA, VGA)
    assert calibration.depth.fx == pytest.approx(580)
    assert f"Orbbec factory calibration not believed: {why}" in derivation
