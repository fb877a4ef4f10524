"""A face in depth alone."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.calibration import Calibration
from denseface.capture.frame import RgbdFrame
from denseface.recon.detection import Detection, detect_by_depth
from denseface.recon.detection._views import turned
from denseface.recon.errors import NoFaceError
from denseface.recon.registration import register, without_color
from tests.simulator import Person
from tests.unit.frames import camera

CAMERA = camera(320, 240, 290.0)
MIDDLE = np.array([10.0, -15.0, 800.0])


def detected(frame: RgbdFrame, rejected=(), *, ahead_only: bool = False) -> Detection:
    sparse = slice(None, None, 4)
    alone = without_color(frame)
    return detect_by_depth(alone, register(alone, sparse, sparse, colors=False), rejected,
                           ahead_only=ahead_only)


def middle_of(box):
    x, y, w, h = box
    return np.array([x + w / 2, y + h / 2])


def test_a_face_is_found_where_it_is(shot):
    found = detected(shot.frame, ahead_only=True)
    points = shot.truth.face_points()
    seen = shot.frame.calibration.depth.project(points)
    to_mm = np.median(points[:, 2]) / shot.frame.calibration.depth.fx
    away = middle_of(found.box) - (seen.min(axis=0) + seen.max(axis=0)) / 2
    assert np.hypot(*away) * to_mm < 25
    assert 135 < found.box[2] * to_mm < 195
    assert found.depth_mm == pytest.approx(np.median(points[:, 2]), abs=30)


def test_what_was_rejected_is_not_found_again(shot):
    box = detected(shot.frame).box
    with pytest.raises(NoFaceError, match="no face by its shape"):
        detected(shot.frame, rejected=(box,))


@pytest.mark.parametrize("turn", [{"yaw": 40.0}, {"pitch": -20.0}, {"roll": 30.0},
                                  {"yaw": 25.0, "pitch": 10.0, "roll": -15.0}])
def test_who_looks_at_a_turned_head_from_its_front_sees_its_own_axes(turn):
    seen = turned(**{"yaw": 0.0, "pitch": 0.0, "roll": 0.0} | turn) @ Person(**turn).rotation
    np.testing.assert_allclose(seen, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("radii", [(75, 75, 75), (70, 105, 90), (60, 300, 60)])
def test_what_only_bulges_is_no_face(radii):
    """A ball, an egg of a head's size, a post."""
    noise = np.random.default_rng(2).normal(0, 1.5, (CAMERA.height, CAMERA.width))
    with pytest.raises(NoFaceError, match="no face found"):
        detected(ellipsoid(radii, noise))


def test_a_wall_leaves_no_place_to_look(monkeypatch):
    monkeypatch.setattr("denseface.recon.detection._by_depth.run_pass", pytest.fail)
    wall = np.full((CAMERA.height, CAMERA.width), 900, np.uint16)
    with pytest.raises(NoFaceError, match="by the depth's shape"):
        detected(depth_frame(wall))


def test_readings_beyond_the_sensors_range_are_none(shot):
    meaning = replace(shot.frame.depth_meaning, max_mm=600)
    with pytest.raises(NoFaceError):
        detected(replace(shot.frame, depth_meaning=meaning, depth=np.where(
            shot.frame.depth == 0, 590, shot.frame.depth).astype(np.uint16)))


def ellipsoid(radii, noise) -> RgbdFrame:
    """One before a wall."""
    scale = 1 / np.array(radii, np.float64)
    rays = np.dstack([CAMERA.rays(), np.ones((CAMERA.height, CAMERA.width))]) * scale
    middle = MIDDLE * scale
    squared = (rays**2).sum(axis=2)
    along = rays @ middle / squared
    inside = along**2 - (middle @ middle - 1) / squared
    z = np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), 1600.0)
    return depth_frame(np.rint(z + noise).astype(np.uint16))


def depth_frame(depth) -> RgbdFrame:
    return RgbdFrame(depth, None, 0, 0, Calibration(depth=CAMERA, color=CAMERA))
