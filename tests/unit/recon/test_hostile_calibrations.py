"""Calibrations and image sizes that no sensor has: one named, final error, and no more memory."""

import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denseface.capture.calibration import CameraModel, DepthToColor
from denseface.recon import ImpossibleFrameError, ReconstructionError, pipeline, reconstruct
from denseface.recon.registration._register import register
from denseface.recon.support import Support
from tests.unit.frames import calibration, camera, frame, resampled

SIDES = [(1, 1), (1, 300), (300, 1), (2, 2), (3, 200), (17, 17), (320, 240), (9000, 2), (2, 9000)]


@pytest.fixture(scope="module")
def small(shot):
    return resampled(shot.frame, 0.5)


def named(one) -> str:
    """Reconstruct, and give the name of what came of it: nothing but a face or an error of ours."""
    try:
        reconstruct(one)
    except ReconstructionError as error:
        if len(str(error).splitlines()) != 1:
            pytest.fail(f"not one clear line: {error!r}")
        return type(error).__name__
    return "Face"


def with_cameras(one, depth_changes, color_changes, **pose):
    """Give a frame under another calibration; what is impossible is not refused here."""
    known = one.calibration
    return replace(one, calibration=known.model_copy(update={
        "depth": known.depth.model_copy(update=depth_changes),
        "color": known.color.model_copy(update=color_changes),
        "depth_to_color": known.depth_to_color.model_copy(update=pose)}))


@pytest.mark.parametrize("changes", [
    {"fx": 1e15}, {"fx": 1e300, "fy": 1e-300}, {"fy": 10.0}, {"fx": 1e-30}, {"cx": 1e300},
    {"cx": -1e9}, {"fx": 1.7e308, "fy": 1.7e308}, {"cy": float("nan")}])
@pytest.mark.parametrize("registered", [False, True])
def test_numbers_that_overflow_are_named(small, changes, registered):
    for depth, color in ((changes, {}), ({}, changes), (changes, changes)):
        named(replace(with_cameras(small, depth, color), registered=registered))


@pytest.mark.parametrize("color_size", SIDES)
@pytest.mark.parametrize("depth_size", SIDES)
def test_images_of_every_size_are_named(small, depth_size, color_size):
    depth = cv2.resize(small.depth, depth_size, interpolation=cv2.INTER_NEAREST)
    color = cv2.resize(small.color, color_size, interpolation=cv2.INTER_NEAREST)
    width, height = depth_size
    wide, high = color_size
    known = small.calibration
    named(replace(
        small, depth=depth.reshape(height, width), color=color.reshape(high, wide, 3),
        calibration=known.model_copy(update={
            "depth": known.depth.model_copy(update={"width": width, "height": height}),
            "color": known.color.model_copy(update={"width": wide, "height": high})})))


@st.composite
def possible(draw, like: CameraModel) -> CameraModel:
    """A camera that is not refused, however odd."""
    def factor(least, most):
        return 10 ** draw(st.one_of(st.floats(least, most), st.floats(-0.5, 0.5)))

    side, wider = max(like.width, like.height), factor(-1.4, 2.4)
    return like.model_copy(update={
        "fx": like.fx * wider * factor(-0.5, 0.5), "fy": like.fy * wider * factor(-0.5, 0.5),
        "cx": like.cx + draw(st.sampled_from([0, 0, -1, 1])) * side * factor(-2, 2.9),
        "cy": like.cy + draw(st.sampled_from([0, 0, -1, 1])) * side * factor(-2, 2.9)})


@settings(deadline=None, max_examples=40,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_cameras_at_the_ends_of_what_is_possible(small, data):
    known = small.calibration
    shift = st.floats(-1e4, 1e4) | st.just(0.0)
    calib = known.model_copy(update={
        "depth": data.draw(possible(known.depth)), "color": data.draw(possible(known.color)),
        "depth_to_color": DepthToColor(
            translation_mm=data.draw(st.tuples(shift, shift, shift)))})
    named(replace(small, calibration=calib, registered=data.draw(st.booleans())))


def test_what_the_numbers_lead_to_is_final_and_says_where(small, monkeypatch):
    def segment(*_):
        return np.empty(0)[1]

    monkeypatch.setattr(pipeline, "segment_face", segment)
    with pytest.raises(ImpossibleFrameError, match="after registration: IndexError: index 1") as it:
        reconstruct(small)
    assert isinstance(it.value.__cause__, IndexError)


def test_a_face_of_many_metres_is_not_computed(small):
    """It took three quarters of a minute, and 1.7 GB."""
    known = small.calibration
    with pytest.raises(ImpossibleFrameError, match="mm across: is the calibration right"):
        reconstruct(with_cameras(
            small, {"fy": known.depth.fy / 50}, {"fy": known.color.fy / 50}))


@pytest.mark.parametrize("spacing", [0.0, 1e-9, float("nan")])
def test_no_grid_is_larger_than_any_face(spacing):
    points = np.random.default_rng(1).uniform(-80, 80, (500, 3)).astype(np.float32)
    with pytest.raises(ImpossibleFrameError, match="is the calibration right"):
        Support.of(points, spacing)


def test_the_rays_of_a_large_camera_take_no_memory():
    """Those of one without distortion are a row and a column."""
    side = 4096
    one = camera(side, side, float(side))
    depth = np.zeros((side, side), np.uint16)
    depth[::512, ::512] = 700
    large = frame(depth, np.zeros((8, 8, 3), np.uint8),
                  calibration(depth=one, color=camera(8, 8, 8.0)))
    tracemalloc.start()
    try:
        register(large, slice(None, None, 64), slice(None, None, 64))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2**21
