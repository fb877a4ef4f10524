"""What has a face's shape, and what has not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from denseface.recon.judgement._judge import LEAST_SCORE, SURE_SCORE, judge_points
from denseface.recon.judgement._likeness import likenesses
from denseface.recon.judgement._placing import mean_face

STEP = 4.0
NOISE_MM = 0.5


def grid(width, height):
    x, y = np.meshgrid(np.arange(-width / 2, width / 2, STEP), np.arange(-height / 2, height / 2,
                                                                        STEP))
    return x.ravel(), y.ravel()


def noisy(x, y, z):
    noise = NOISE_MM * np.random.default_rng(5).standard_normal(len(x))
    return np.stack([x, y, z + noise + 800.0], axis=1)[np.isfinite(z)]


def tin(radius=60.0, tilt=0.15):
    x, y = grid(2 * radius - STEP, 150)
    return noisy(x, y, -np.sqrt(radius**2 - x**2) + tilt * y)


def ball(radius=90.0):
    x, y = grid(2 * radius, 2 * radius)
    inside = np.where(x**2 + y**2 < 0.95 * radius**2, x**2 + y**2, np.nan)
    return noisy(x, y, -np.sqrt(radius**2 - inside))


def carton():
    """A box whose edge looks at the camera."""
    x, y = grid(140, 200)
    return noisy(x, y, np.where(x < 20, -0.5 * x, 1.2 * x - 34) + 0.1 * y)


def flat():
    x, y = grid(150, 200)
    return noisy(x, y, 0.3 * x + 0.1 * y)


def waves():
    """As uneven as a face."""
    x, y = grid(140, 190)
    return noisy(x, y, 8 * np.sin(x / 15) * np.sin(y / 20) + (x / 20)**2)


def mean_face_seen(*turn, scale=1.0):
    """The mean face, turned by some degrees (roll, yaw, pitch), as a camera samples it."""
    mould = mean_face()
    rows, columns = mould.radius.shape
    angle, height = np.meshgrid(mould.first_angle + mould.angle_step * np.arange(columns),
                                mould.first_height + mould.height_step * np.arange(rows))
    face = np.stack([mould.radius * np.sin(angle), height,
                     mould.axis_z - mould.radius * np.cos(angle)], axis=-1)
    face = face[(np.abs(angle) < 1.2) & (np.abs(height) < 90)] * scale
    face = face @ Rotation.from_euler("ZYX", turn, degrees=True).as_matrix().T
    # Of each cell the nearest point.
    order = np.argsort(-face[:, 2])
    cells = np.rint(face[order, :2] / STEP).astype(int)
    nearest = dict(zip(map(tuple, cells.tolist()), face[order, 2], strict=True))
    x, y = STEP * np.array(list(nearest)).T
    return noisy(x, y, np.array(list(nearest.values())))


@pytest.mark.parametrize(("thing", "like"), [
    (tin, "round like a tin"), (ball, "round like a ball"), (carton, "uneven"), (flat, "flat"),
    (waves, "uneven")])
def test_things_are_no_faces_and_are_named(thing, like):
    score, said, _ = judge_points(thing())
    assert score < 0.3
    assert said.startswith(like)


def test_a_few_points_are_no_face():
    assert judge_points(tin()[:50]) == (0.0, "too small", None)


@pytest.mark.parametrize("turn", [
    (0, 0, 0), (0, 40, 0), (0, -55, 0), (25, 0, 0), (-25, 20, 0), (0, 0, 20), (0, 0, -20)])
@pytest.mark.parametrize("scale", [0.75, 1.0])
def test_a_face_is_one_however_it_is_turned(turn, scale):
    score, said, _ = judge_points(mean_face_seen(*turn, scale=scale))
    assert score > SURE_SCORE
    assert said == ""


def test_a_face_is_laid_where_it_is():
    points = mean_face_seen(10, 20, 0, scale=0.9)
    found = max(likenesses(points), key=lambda one: one.face)
    assert found.face > 0.95
    assert found.distance_mm < 2
    assert found.placement[12] == pytest.approx(0.9, abs=0.03)
    assert found.roll_deg == pytest.approx(10, abs=4)


def test_a_mirrored_or_inverted_relief_is_no_face():
    points = mean_face_seen(0, 0, 0)
    points[:, 2] = 1600 - points[:, 2]
    assert judge_points(points)[0] < LEAST_SCORE
    upside_down = mean_face_seen(0, 0, 0) * (1, -1, 1)
    assert judge_points(upside_down)[0] < LEAST_SCORE
