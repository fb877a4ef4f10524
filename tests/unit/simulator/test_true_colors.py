"""The true shaded colours, against the image that the simulator renders of the same scene."""

import numpy as np
import pytest

from tests.simulator import KINECT_CALIBRATED, Light, Person, Scene, TrueColors
from tests.simulator.camera_views import color_view

SENSOR = KINECT_CALIBRATED
SCENE = Scene((Person(distance_mm=700, yaw=15),), light=Light((1.0, -0.2, -0.6), 0.8, 0.25))


@pytest.fixture(scope="module")
def truth():
    return TrueColors.of(SCENE, SENSOR)


def off(truth, scene):
    known = SENSOR.calibration
    at = known.color.project(known.depth_to_color.apply(truth.points))
    column, row = np.rint(at).astype(int).T
    return np.abs(color_view(scene, SENSOR)[row, column] - truth.colors).mean(axis=1)


def test_they_are_those_of_the_image_but_for_its_blur(truth):
    error = off(truth, SCENE)
    assert np.median(error[truth.seen]) < 1.5
    assert error[truth.seen].mean() < 6
    # Where another part hides the point, the image shows that part.
    assert 0 < (~truth.seen).mean() < 0.05
    assert error[~truth.seen].mean() > 3 * error[truth.seen].mean()


def test_they_follow_the_light(truth):
    other = TrueColors.of(Scene(SCENE.people), SENSOR)
    np.testing.assert_array_equal(other.points, truth.points)
    assert np.abs(other.colors - truth.colors).mean() > 15


def test_the_nearest_sample_of_a_sample_is_itself(truth):
    some = np.arange(0, len(truth.points), 97)
    np.testing.assert_array_equal(truth.nearest(truth.points[some]), some)


def test_features_are_around_eyes_and_mouth(truth):
    assert 0.05 < truth.feature.mean() < 0.3
    x, y, _ = truth.points[truth.feature].T
    assert np.ptp(y) < 140
    assert np.ptp(x) < 130


def test_a_wall_has_the_paint_asked_for():
    scene = Scene((), wall_mm=1500, wall_color=(30, 220, 40))
    red, green, blue = np.median(color_view(scene, SENSOR).reshape(-1, 3), axis=0)
    assert green > 150
    assert max(red, blue) < 80


def test_nobody_has_no_colours():
    with pytest.raises(ValueError, match="nobody"):
        TrueColors.of(Scene(()), SENSOR)
