import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.capture.openni2._calibration import SensorProperties, derive_calibration

VGA = (640, 480)


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
    calibration, _ = derive_calibration(SensorProperties(zpd_mm=zpd, zpps_mm=zpps), size, size)
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
