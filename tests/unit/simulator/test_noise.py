"""The simulated depth against what was measured on a real Kinect.

The figures are of the recording that the project was given, `kinect_v1_room_no_face.oni`: the
median over pixels of the standard deviation over 12 frames, and the correlation of neighbouring
pixels' deviations.
"""

import numpy as np
import pytest

from tests.simulator import Label, Person, Scene, simulate


@pytest.fixture(scope="module")
def depth():
    """Twelve frames of three people, (12, 480, 640) float64 mm."""
    people = (Person(distance_mm=640, offset_mm=(-170, 30)), Person(distance_mm=850),
              Person(distance_mm=1150, offset_mm=(400, -60)))
    shown = simulate(Scene(people=people), frames=12)
    return np.stack([one.frame.depth for one in shown]).astype(np.float64)


def deviations(depth, nearest, farthest):
    """Give the deviations from the mean over time, NaN where a pixel is not always in range."""
    mean = depth.mean(axis=0)
    steady = (depth > 0).all(axis=0) & (mean > nearest) & (mean < farthest)
    return np.where(steady, depth - mean, np.nan)


@pytest.mark.parametrize(("nearest", "farthest", "real"), [
    (550, 750, 1.22), (750, 1000, 1.24), (1000, 1500, 2.3),
])
def test_noise_over_time_is_a_real_kinects(depth, nearest, farthest, real):
    moved = deviations(depth, nearest, farthest)
    steady = moved[:, np.isfinite(moved[0])]
    assert steady.shape[1] > 10_000
    assert np.median(steady.std(axis=0, ddof=1)) == pytest.approx(real, rel=0.15)


def test_neighbours_err_together_as_on_a_real_kinect(depth):
    moved = deviations(depth, 550, 1000)

    def correlation(step):
        a, b = moved[:, :, :-step].ravel(), moved[:, :, step:].ravel()
        both = np.isfinite(a) & np.isfinite(b)
        return np.corrcoef(a[both], b[both])[0, 1]

    # Real, along x and y at 0.55-1.0 m: 0.61-0.74, 0.29-0.43, 0.10-0.17.
    assert 0.55 < correlation(1) < 0.80
    assert 0.25 < correlation(3) < 0.50
    assert 0.05 < correlation(6) < 0.25


def test_some_pixels_come_and_go(depth):
    seen = (depth > 0).sum(axis=0)
    share = ((seen > 0) & (seen < len(depth))).sum() / (seen > 0).sum()
    assert 0.02 < share < 0.12  # real: 0.075


def test_a_flat_wall_is_flat_but_for_noise():
    depth = simulate(Scene(people=(), wall_mm=800))[0].frame.depth
    seen = depth[depth > 0].astype(float)
    assert len(seen) > 0.97 * depth.size
    # The driver cuts depths to whole millimetres, so they are up to one too near.
    assert 799 < seen.mean() < 800.1
    assert 1.0 < seen.std() < 2.0


def test_holes_grow_with_their_level():
    def empty(holes):
        shown = simulate(Scene(people=(Person(distance_mm=700),), holes=holes))[0]
        truth = shown.truth
        labels = np.zeros((960, 1280), np.uint8)
        labels[truth.top:truth.top + truth.labels.shape[0],
               truth.left:truth.left + truth.labels.shape[1]] = truth.labels
        face = (labels[::2, ::2] == Label.FACE) & (labels[1::2, 1::2] == Label.FACE)
        return (shown.frame.depth[face] == 0).mean()

    none, usual, many = empty(0), empty(0.25), empty(1)
    assert none < usual < many
    assert none < 0.04
    assert 0.08 < many < 0.35
