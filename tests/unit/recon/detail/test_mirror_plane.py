"""The plane of symmetry is found however a face is held, and whatever one side has of its own."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from denseface.recon.detail._mirror_kernels import HeightField
from denseface.recon.detail._mirror_plane import find_plane
from tests.unit.recon.mirror_shapes import Pose, face_points, height

STEP = 1.5


def field_of(points):
    """A height field of the nearest points."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    xs, ys = (np.arange(low[k], high[k], STEP) for k in (0, 1))
    X, Y = np.meshgrid(xs, ys)
    away, nearest = cKDTree(points[:, :2]).query(np.stack([X, Y], axis=-1), k=4)
    weight = 1 / (away + 0.05)
    z = (points[nearest, 2] * weight).sum(axis=-1) / weight.sum(axis=-1)
    dy, dx = np.gradient(z, STEP)
    planes = np.stack([z, 1 / np.sqrt(1 + dx * dx + dy * dy), away[..., 0] < STEP], axis=-1)
    return HeightField(planes.astype(np.float32), np.array([low[0], low[1], 0.0]), STEP)


def found(points):
    return find_plane(field_of(points))


def off(plane, pose):
    """Angle, degrees, and distance at the face's middle, mm, from the true plane."""
    true = pose.plane
    angle = np.degrees(np.arccos(min(1.0, abs(plane.normal @ true.normal))))
    return angle, abs(plane.normal @ pose.shift - plane.offset)


POSES = [Pose(), Pose(yaw=20), Pose(yaw=-20, pitch=10), Pose(yaw=12, roll=25), Pose(roll=-40),
         Pose(yaw=-15, pitch=-12, roll=8, shift=(120, -60, 200)), Pose(roll=90), Pose(roll=180)]


@pytest.mark.parametrize("pose", POSES)
def test_however_the_face_is_held(pose):
    angle, distance = off(found(face_points(pose)), pose)
    assert angle < 0.5
    assert distance < 0.5


@pytest.mark.parametrize("pose", POSES[:4])
def test_noise_moves_it_little(pose):
    points = face_points(pose)
    points[:, 2] += np.random.default_rng(1).normal(0, 0.5, len(points))
    angle, distance = off(found(points), pose)
    assert angle < 1
    assert distance < 1


@pytest.mark.parametrize("pose", POSES[:4])
def test_a_swollen_cheek_draws_it_little(pose):
    def swollen(x, y):
        return -8 * np.exp(-((x - 38) ** 2 + (y - 25) ** 2) / (2 * 12**2))

    angle, distance = off(found(face_points(pose, one_side=swollen)), pose)
    assert angle < 1
    assert distance < 1


def test_half_of_one_side_may_be_missing():
    pose = Pose(yaw=10)
    points = face_points(pose)
    points = points[pose.own(points)[:, 0] < 30]
    angle, distance = off(found(points), pose)
    assert angle < 1
    assert distance < 1


def test_none_where_there_is_next_to_nothing():
    points = face_points(Pose())
    assert found(points[np.hypot(*points[:, :2].T) < 12]) is None
    empty = np.zeros((40, 40, 3), np.float32)
    assert find_plane(HeightField(empty, np.zeros(3), STEP)) is None


def test_a_ball_has_some_plane_through_its_middle():
    axis = np.arange(-60, 60, STEP)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    x, y = x[np.hypot(x, y) < 55], y[np.hypot(x, y) < 55]
    plane = found(np.column_stack([x, y, 780 - np.sqrt(80.0**2 - x * x - y * y)]))
    assert np.linalg.norm(plane.normal) == pytest.approx(1)
    assert abs(plane.normal @ (0, 0, 780) - plane.offset) < 1


def test_a_flat_plate_is_no_error():
    axis = np.arange(-60, 60, STEP)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    plane = found(np.column_stack([x, y, np.full(len(x), 700.0)]))
    assert plane is None or np.isfinite([*plane.normal, plane.offset]).all()


def test_the_shape_is_even():
    x, y = np.random.default_rng(0).uniform(-60, 60, (2, 50))
    np.testing.assert_array_equal(height(x, y), height(-x, y))
