"""Frames and truth tell of the same surface through the same calibration."""

import numpy as np
import pytest

from tests.simulator import KINECT_CALIBRATED, KINECT_DEFAULT, Label, Person, Scene, simulate
from tests.simulator.camera_views import color_view, depth_view
from tests.simulator.scene import Light

SENSORS = pytest.mark.parametrize("sensor", [KINECT_DEFAULT, KINECT_CALIBRATED],
                                  ids=["default", "calibrated"])
SCENE = Scene(people=(Person(distance_mm=700, yaw=10),))


def back_projected(frame):
    v, u = np.nonzero(frame.depth)
    return frame.calibration.depth.back_project(np.stack([u, v], axis=-1), frame.depth[v, u])


@SENSORS
def test_measured_points_lie_on_the_true_surface_but_for_noise(sensor):
    shown = simulate(SCENE, sensor)[0]
    points = back_projected(shown.frame)
    on_face = points[shown.truth.labels_at(points) == Label.FACE]
    assert len(on_face) > 10_000
    error = shown.truth.depth_error(on_face)
    assert np.isfinite(error).mean() > 0.95
    # The driver cuts its table of depths to whole millimetres: half of one too near.
    assert np.nanmedian(error) == pytest.approx(-0.5, abs=0.35)
    # At the rim a pixel may show the wall instead: so few, and so far off.
    rim = np.abs(np.nan_to_num(error, nan=np.inf)) > 20
    assert rim.mean() < 0.06
    assert 0.9 < np.abs(error[~rim]).mean() < 1.8
    distance = shown.truth.surface_distance(on_face[~rim])
    assert 0.7 < distance.mean() < 1.4
    assert (distance <= np.abs(error[~rim]) + 0.05).mean() > 0.999


@SENSORS
def test_the_face_stands_where_the_scene_says(sensor):
    face = simulate(SCENE, sensor)[0].truth.face_points()
    nearest = face[np.argmin(face[:, 2])]
    assert 660 < nearest[2] < 700  # the tip of the nose is before the bridge
    assert nearest[0] > 0  # turned toward +x
    assert abs(face[:, 0].mean()) < 25
    assert abs(face[:, 1].mean()) < 25


@SENSORS
def test_colour_belongs_to_the_surface_that_depth_sees(sensor):
    """A point's colour, looked up through the calibration, is that of the point."""
    scene = Scene(people=(Person(distance_mm=700),), light=Light(intensity=0.0, ambient=1.0))
    view, image = depth_view(scene, sensor), color_view(scene, sensor)
    truth = simulate(scene, sensor)[0].truth
    points = truth.face_points()
    at = sensor.calibration.color.project(sensor.calibration.depth_to_color.apply(points))
    column, row = np.rint(at).astype(int).T
    rows, columns = np.nonzero(view.labels == Label.FACE)
    assert len(rows) == len(points)
    expected = 255 * view.albedo[rows, columns] ** (1 / 2.2)

    def mismatch(shift_x, shift_y):
        seen = image[row + shift_y, column + shift_x].mean(axis=1)
        return np.abs(seen - expected).mean()

    aligned = mismatch(0, 0)
    assert aligned < 6
    for away in ((-2, 0), (2, 0), (0, -2), (0, 2)):
        assert mismatch(*away) > 1.2 * aligned


@SENSORS
def test_the_shadow_is_on_the_side_away_from_the_projector(sensor):
    shown = simulate(Scene(people=(Person(distance_mm=700),), wall_mm=1500), sensor)[0]
    row = shown.frame.depth[240]
    face = np.flatnonzero((row > 0) & (row < 1000))
    left = (row[face[0] - 50:face[0]] == 0).sum()
    right = (row[face[-1] + 1:face[-1] + 51] == 0).sum()
    # Width of the shadow: f b (1/700 - 1/1500) = 33 pixels.
    if sensor.projector_mm[0] > 0:
        assert left > 20 > 8 > right
    else:
        assert right > 20 > 8 > left
    assert sensor.projector_mm[0] * sensor.calibration.depth_to_color.translation_mm[0] < 0


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    first, again = (simulate(SCENE, seed=5, frames=2) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        assert a.frame.depth.tobytes() == b.frame.depth.tobytes()
        assert a.frame.rgb.tobytes() == b.frame.rgb.tobytes()
    assert (first[0].frame.depth != first[1].frame.depth).any()
    assert (first[0].frame.depth != simulate(SCENE, seed=6)[0].frame.depth).any()


def test_light_from_one_side_leaves_the_other_darker_and_the_depth_alone():
    lit = Scene(people=(Person(),), light=Light(toward=(1, -0.2, -0.4), ambient=0.15))
    shown = simulate(lit)[0]
    plain = simulate(Scene(people=(Person(),)))[0]
    np.testing.assert_array_equal(shown.frame.depth, plain.frame.depth)
    points = shown.truth.face_points()
    calibration = shown.frame.calibration
    at = calibration.color.project(calibration.depth_to_color.apply(points))
    column, row = np.rint(at).astype(int).T
    brightness = shown.frame.rgb[row, column].mean(axis=1)
    assert brightness[points[:, 0] > 20].mean() > 1.5 * brightness[points[:, 0] < -20].mean()
