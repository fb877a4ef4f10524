"""Two noisy sides are better than one; what one side has alone neither fades nor moves over."""

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from denseface.recon.detail._mirror_kernels import HeightField
from denseface.recon.detail._mirror_plane import MirrorPlane
from denseface.recon.detail._symmetry import symmetry_correction
from denseface.recon.noise import Noise
from denseface.recon.surface import fit_surface
from tests.unit.recon.mirror_shapes import Pose, face_points, height
from tests.unit.recon.shapes import with_detail

SPACING = 1.5
# Parts of the variance and correlation lengths, points, as a Kinect's (`tests/simulator/noise.py`).
NOISE_MM = 1.2
NOISE_PARTS = ((0.18, 0.0), (0.46, 1.4), (0.36, 3.1))
NOISE = Noise(white_mm=0.5, smooth_mm=1.1, length_px=2.0, quantum_mm=0.0)
"""What is measured of it."""
TURNED = Pose(yaw=12, roll=-5, shift=(20, -10, 0))


def bump(x, y):
    return -4 * np.exp(-((x - 34) ** 2 + (y - 25) ** 2) / (2 * 6**2))


def groove(x, y):
    return 3 * np.exp(-((x - 36) ** 2) / (2 * 4**2) - ((y - 20) ** 2) / (2 * 14**2))


def tilted(x, y):
    """No face is even: a broad difference of the sides."""
    return 1.5 * np.sin(x / 40)


def noisy(points, pose, seed):
    """Points moved along z by noise that neighbours share, (n, 3) float32 mm."""
    rng = np.random.default_rng(seed)
    columns, rows = np.rint(pose.own(points)[:, :2] / SPACING).astype(int).T + 100
    total = np.zeros(len(points))
    for share, length in NOISE_PARTS:
        field = rng.standard_normal((200, 200))
        if length:
            field = gaussian_filter(field, length)
        total += np.sqrt(share) * (field / field.std())[rows, columns]
    return (points + np.outer(NOISE_MM * total, (0, 0, 1))).astype(np.float32)


@cache
def errors(symmetry, pose=TURNED, one_side=None, hole=False, seeds=3):
    """Height errors of some noisy faces at places of the face's own frame: x, y, (faces, n)."""
    axis = np.arange(-60.0, 61.0, 2)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    inside = (x / 52) ** 2 + (y / 74) ** 2 < 1
    x, y = x[inside], y[inside]
    own = 0 if one_side is None else one_side(x, y)
    true = pose.placed(np.column_stack([x, y, height(x, y) + own]))
    found = []
    for seed in range(seeds):
        points = noisy(face_points(pose, SPACING, one_side), pose, seed)
        if hole:
            at = pose.own(points)
            points = points[np.hypot(at[:, 0] - 30, at[:, 1] + 22) > 12]
        broad = fit_surface(points, 14 * SPACING, 12)
        surface = with_detail(broad, points, SPACING, 1.5 * SPACING, symmetry=symmetry, noise=NOISE)
        found.append([surface.sampled(true[k:k + 1, 0], true[k:k + 1, 1])[0, 0, 0]
                      for k in range(len(true))] - true[:, 2])
    return x, y, np.array(found)


def rms(where, symmetry, **how):
    x, y, error = errors(symmetry, **how)
    return float(np.sqrt((error[:, where(x, y)] ** 2).mean()))


def anywhere(x, y):
    return x == x


@pytest.mark.parametrize("pose", [TURNED, Pose(yaw=-20, pitch=10)])
def test_noise_falls(pose):
    assert rms(anywhere, True, pose=pose) < 0.95 * rms(anywhere, False, pose=pose)


def test_sides_that_differ_broadly_lose_nothing():
    assert (rms(anywhere, True, one_side=tilted) < rms(anywhere, False, one_side=tilted))


def test_a_hole_is_filled_by_what_the_other_side_shows():
    def inside(x, y):
        return np.hypot(x - 30, y + 22) < 11

    assert rms(inside, True, hole=True) < 0.85 * rms(inside, False, hole=True)


ONE_SIDED = pytest.mark.parametrize(("shape", "height_mm", "x", "y"), [
    (bump, 4, 34, 25), (groove, 3, 36, 20)])


@ONE_SIDED
def test_what_one_side_has_stays_there(shape, height_mm, x, y):
    def there(at_x, at_y):
        return np.hypot(at_x - x, at_y - y) < 12

    how = {"one_side": shape, "seeds": 6}
    assert rms(there, True, **how) < 1.05 * rms(there, False, **how)


@ONE_SIDED
def test_less_than_a_tenth_of_it_shows_on_the_other_side(shape, height_mm, x, y):
    at_x, at_y, with_it = errors(True, one_side=shape, seeds=6)
    _, _, without = errors(False, one_side=shape, seeds=6)
    image = np.hypot(at_x + x, at_y - y) < 6
    assert abs((with_it - without)[:, image].mean()) < 0.1 * height_mm


@pytest.fixture(scope="module")
def half():
    """One side, and a fit of it."""
    points = noisy(face_points(TURNED, SPACING), TURNED, 0)
    points = points[TURNED.own(points)[:, 0] < -8]
    return points, fit_surface(points, 14 * SPACING, 12)


def test_half_a_face_is_no_worse_for_it(half):
    points, broad = half
    found = []
    at = TURNED.own(points)
    true = TURNED.placed(np.column_stack([at[:, :2], height(at[:, 0], at[:, 1])]))[::5]
    for symmetry in (False, True):
        surface = with_detail(broad, points, SPACING, 1.5 * SPACING, symmetry=symmetry, noise=NOISE)
        found.append(np.std([surface.sampled(one[:1], one[1:2])[0, 0, 0] - one[2] for one in true]))
    assert found[1] < 1.02 * found[0]


@pytest.mark.parametrize("plane", [MirrorPlane(np.array([1.0, 0, 0]), 500.0),
                                   MirrorPlane(np.array([0.0, 0, 1]), 0.0)])
def test_a_plane_beside_the_face_adds_nothing(plane):
    planes = np.ones((30, 20, 5), np.float32)
    planes[..., 0] = 700
    field = HeightField(planes, np.zeros(3), 1.5)
    none = np.zeros((30, 20), np.float32)
    added = symmetry_correction(field, none, none, none, plane, 0.1, 0.25, 11.0)
    np.testing.assert_array_equal(added, 0)


def test_without_noise_nothing_changes():
    x, y = np.meshgrid(np.arange(-30.0, 31), np.arange(-30.0, 31))
    z = height(x, y)
    dy, dx = np.gradient(z)
    detail = 0.5 * np.cos(x / 4)
    facing = 1 / np.sqrt(1 + dx * dx + dy * dy)
    planes = np.stack([700 + z, facing, np.ones_like(z), detail * facing, np.ones_like(z)],
                      axis=-1).astype(np.float32)
    field = HeightField(planes, np.array([-30.0, -30.0, 0.0]), 1.0)
    none = np.zeros(z.shape, np.float32)
    added = symmetry_correction(field, detail.astype(np.float32), none, none,
                                MirrorPlane(np.array([1.0, 0, 0]), 0.0), 0.0, 0.25, 11.0)
    assert np.isfinite(added).all()
    assert np.abs(added).max() < 0.01


def test_the_same_seeds_give_the_same_bytes(half):
    points, broad = half
    one, other = (with_detail(broad, points, SPACING, 1.5 * SPACING, symmetry=True).values
                  for _ in range(2))
    np.testing.assert_array_equal(one, other)
