"""A face of the model is found again in its heights, and other shapes are far from all faces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from denseface.recon.prior import FittedFace, HeadPose, Heights, basis, fit_face, mean_face

ORIGIN, STEP, SHAPE = (-90.0, -140.0), 2.6, (108, 78)
X, Y = np.meshgrid(ORIGIN[0] + STEP * np.arange(SHAPE[1]), ORIGIN[1] + STEP * np.arange(SHAPE[0]))
SHIFT = np.array([10.0, -20.0, 750.0])
MODES = basis().modes.shape[2]


def person(seed, yaw=0.0, pitch=0.0, roll=0.0):
    weights = np.random.default_rng(seed).standard_normal(MODES).clip(-2, 2)
    turn = Rotation.from_euler("ZYX", [roll, yaw, pitch], degrees=True).as_matrix()
    return FittedFace(turn, SHIFT, weights, 0.0, 1.0)


def seen(face, noise=0.0):
    """The heights of a face within an oval."""
    heights, known = face.heights(ORIGIN, STEP, SHAPE)
    known &= ((X - SHIFT[0]) / 62) ** 2 + ((Y - SHIFT[1]) / 85) ** 2 < 1
    heights += np.random.default_rng(3).normal(0, noise, SHAPE).astype(np.float32)
    return field(heights, known)


def field(heights, known):
    return Heights(np.asarray(heights, np.float32), known.astype(np.float32), ORIGIN, STEP)


def without(whole, x, y, radius):
    hole = np.hypot(X - x, Y - y) < radius
    return whole._replace(weights=np.where(hole, np.float32(0), whole.weights)), hole


PEOPLE = [person(0), person(1, yaw=20), person(2, yaw=-20, pitch=10), person(3, pitch=-15),
          person(4, yaw=10, pitch=10, roll=12)]


@pytest.mark.parametrize("face", PEOPLE)
def test_a_face_of_the_model_is_found_again(face):
    true = seen(face)
    found = fit_face(true)
    heights, known = found.heights(ORIGIN, STEP, SHAPE)
    both = known & (true.weights > 0)
    assert both.sum() > 0.97 * (true.weights > 0).sum()
    assert np.abs(heights - true.heights)[both].mean() < 0.9
    assert np.degrees(np.arccos((np.trace(found.rotation.T @ face.rotation) - 1) / 2)) < 5
    assert np.corrcoef(found.weights[:12], face.weights[:12])[0, 1] > 0.8
    assert found.rms_mm < 0.5
    assert unusual(found) < 1


@pytest.mark.parametrize("face", PEOPLE[:3])
@pytest.mark.parametrize(("x", "y"), [(35, -15), (10, 45)], ids=["cheek", "chin"])
def test_what_is_hidden_is_predicted(face, x, y):
    noisy = seen(face, noise=0.7)
    holed, hole = without(noisy, SHIFT[0] + x, SHIFT[1] + y, 14)
    heights, known = fit_face(holed).heights(ORIGIN, STEP, SHAPE)
    hidden = hole & known & (noisy.weights > 0)
    error = (heights - seen(face).heights)[hidden]
    assert np.abs(error).mean() < 1.2


@pytest.mark.parametrize("roll", [0, 90, 200])
def test_a_pose_may_be_told(roll):
    face = person(1, yaw=20, roll=roll)
    nearly = face.rotation @ Rotation.from_euler("ZYX", [4, -5, 4], degrees=True).as_matrix()
    told = HeadPose(nearly, face.shift - nearly @ (0, 9, 24) + (3, -3, 4))
    assert fit_face(seen(face), told).rms_mm < 0.5


def test_the_mean_face_is_itself():
    face = mean_face(700.0)
    heights, known = face.heights(ORIGIN, STEP, SHAPE)
    found = fit_face(field(heights, known))
    assert np.abs(found.weights).max() < 0.3


@pytest.mark.parametrize("heights", [
    np.full(SHAPE, 700.0),
    700 + 0.4 * np.abs(X),
    800 - np.sqrt(np.maximum(95.0**2 - X**2, 0)),
    700 + 6 * np.sin(X / 6) + 6 * np.cos(Y / 5),
], ids=["plate", "edge", "tin", "waves"])
def test_what_is_no_face_is_farther_from_all_faces(heights):
    found = fit_face(field(heights, (X / 65) ** 2 + (Y / 85) ** 2 < 1))
    assert found is None or found.rms_mm > 0.9 or unusual(found) > 1.5


def unusual(face):
    """The weights' norm over what is usual."""
    return np.linalg.norm(face.weights) / np.sqrt(len(face.weights))


def test_nothing_is_fitted_to_next_to_nothing():
    assert fit_face(field(np.zeros(SHAPE), np.zeros(SHAPE, bool))) is None
    whole = seen(PEOPLE[0])
    few = np.hypot(X - SHIFT[0], Y - SHIFT[1]) < 12
    assert fit_face(whole._replace(weights=whole.weights * few.astype(np.float32))) is None


def test_the_nearest_of_two_sides_is_drawn():
    """The nose hides a part of the cheek from a camera at the side."""
    turned = person(0, yaw=35)
    heights, known = turned.heights(ORIGIN, STEP, SHAPE)
    model = basis()
    points = model.vertices + model.modes @ turned.weights.astype(np.float32)
    points = points @ turned.rotation.T + turned.shift
    columns, rows = (np.rint((points[:, axis] - ORIGIN[axis]) / STEP).astype(int)
                     for axis in (0, 1))
    inside = (rows >= 0) & (rows < SHAPE[0]) & (columns >= 0) & (columns < SHAPE[1])
    rows, columns, z = rows[inside], columns[inside], points[inside, 2]
    drawn = known[rows, columns]
    behind = (heights[rows, columns] - z)[drawn]
    assert behind.min() < -15, "what is hidden"
    assert np.percentile(behind, 90) < 2
