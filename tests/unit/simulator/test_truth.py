"""The truth file and the distances that it answers."""

import numpy as np
import pytest

from tests.simulator import (
    KINECT_CALIBRATED,
    KINECT_DEFAULT,
    Label,
    Person,
    Scene,
    Truth,
    simulate,
)

SCENE = Scene(people=(Person(distance_mm=700, yaw=-15, pitch=5), Person(
    distance_mm=1200, offset_mm=(250, 0))))


@pytest.fixture(scope="module", params=[KINECT_DEFAULT, KINECT_CALIBRATED],
                ids=["default", "calibrated"])
def truth(request):
    return simulate(SCENE, request.param)[0].truth


def test_a_saved_truth_comes_back_exactly_and_is_small(truth, tmp_path):
    path = tmp_path / "truth.npz"
    truth.save(path)
    loaded = Truth.load(path)
    assert path.stat().st_size <= 200_000
    assert loaded.camera == truth.camera
    assert (loaded.left, loaded.top) == (truth.left, truth.top)
    np.testing.assert_array_equal(loaded.depth, truth.depth)
    np.testing.assert_array_equal(loaded.labels, truth.labels)
    assert loaded.depth.dtype == np.float32
    with np.load(path, allow_pickle=False) as data:
        assert all(data[key].dtype != object for key in data.files)


def test_a_truth_without_anybody_comes_back(tmp_path):
    empty = simulate(Scene(people=()))[0].truth
    empty.save(tmp_path / "empty.npz")
    loaded = Truth.load(tmp_path / "empty.npz")
    assert loaded.labels.shape == (0, 0)
    assert len(loaded.face_points()) == 0
    point = np.array([[0.0, 0.0, 700.0]])
    assert loaded.surface_distance(point)[0] == np.inf
    assert loaded.labels_at(point)[0] == Label.NONE
    assert np.isnan(loaded.depth_error(point)[0])


def test_true_points_are_on_the_true_surface(truth):
    face = truth.face_points()
    assert len(face) > 50_000
    assert np.quantile(truth.surface_distance(face), 0.99) < 0.02
    assert np.nanmax(np.abs(truth.depth_error(face))) < 0.02
    assert (truth.labels_at(face) == Label.FACE).all()


def test_errors_are_signed_along_z_and_distances_are_not_longer(truth):
    face = truth.face_points()[::50]
    for moved in (-3.0, 2.0):
        points = face * (1 + moved / face[:, 2:])
        np.testing.assert_allclose(np.nanmedian(truth.depth_error(points)), moved, atol=0.05)
        distance = truth.surface_distance(points)
        assert np.quantile(distance, 0.99) <= 1.1 * abs(moved) + 0.1


def test_labels_tell_the_parts_apart(truth):
    found = set(np.unique(truth.labels).tolist())
    assert {Label.FACE, Label.HEAD, Label.BACKGROUND} <= found
    row, column = np.argwhere(truth.labels == Label.BACKGROUND)[0]
    wall = truth.camera.back_project(
        np.array([[column + truth.left, row + truth.top]]), np.array([2000.0]))
    assert truth.labels_at(wall)[0] == Label.BACKGROUND
    assert truth.labels_at(np.array([[2000.0, 0.0, 700.0]]))[0] == Label.NONE
    assert np.isnan(truth.depth_error(wall)[0])
    assert truth.surface_distance(wall)[0] > 20


def test_the_nearest_person_is_the_target():
    near = Person(distance_mm=700, offset_mm=(-150, 0))
    far = Person(distance_mm=1100, offset_mm=(150, 0))
    assert [Scene(people=people).target for people in ((near, far), (far, near), ())] == [0, 1, -1]
    truth = simulate(Scene(people=(far, near)))[0].truth
    assert truth.face_points()[:, 0].mean() < -100


def test_glasses_and_hand_have_labels_of_their_own():
    truth = simulate(Scene(people=(Person(glasses=True, hand=True),)))[0].truth
    assert (truth.labels == Label.GLASSES).sum() > 500
    assert (truth.labels == Label.HAND).sum() > 3000


def test_a_depth_range_too_long_for_the_file_is_refused(truth, tmp_path):
    depth = truth.depth.copy()
    depth.flat[np.flatnonzero(depth)[0]] += 2000
    long = Truth(truth.camera, truth.left, truth.top, depth, truth.labels)
    with pytest.raises(ValueError, match="1310"):
        long.save(tmp_path / "long.npz")
