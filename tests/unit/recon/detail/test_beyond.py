"""Past its outline a face goes on where nothing was read, as faces do, and nowhere else."""

import numpy as np
import pytest

from denseface.recon.detail import beyond_outline
from denseface.recon.intermediate import SurfaceGrid
from denseface.recon.prior import basis, mean_face
from denseface.recon.support import Support

SPACING = 1.6
AT_MM = 700.0
WEIGHTS = np.random.default_rng(5).normal(0, 0.8, basis().modes.shape[2])


def height(xs, ys):
    """A face that is not the mean, 0 where there is none."""
    face = mean_face(AT_MM)
    face.weights[:] = WEIGHTS
    heights, _ = face.heights((float(xs[0]), float(ys[0])), float(xs[1] - xs[0]),
                                 (len(ys), len(xs)))
    return heights


def measured(missing, shape=height):
    """The surface of a face, but for what is missing of it: (x, y) to bool."""
    axes = np.arange(-60, 60, SPACING), np.arange(-75, 75, SPACING)
    X, Y = np.meshgrid(*axes)
    seen = ((X / 55) ** 2 + (Y / 70) ** 2 < 1) & ~missing(X, Y)
    z = shape(*axes)
    support = Support.of(np.stack([X, Y, z], axis=-1)[seen].astype(np.float32), SPACING)
    heights = shape(support.xs, support.ys).astype(np.float32)
    # Past the outline a fit says something else.
    heights += np.where(support.inside, np.float32(0), np.float32(15))
    dy, dx = np.gradient(heights, support.step)
    return SurfaceGrid(np.stack([heights, dx, dy]).astype(np.float32), support, detailed=True)


def bay(x, y):
    """Beside the mouth, open to the side."""
    return (np.abs(y - 30) < 8) & (x > 30)


def lower(x, y):
    """From the mouth down."""
    return y > 20 + 0 * x


def nothing(points):
    return np.zeros(len(points), np.float32)


def added(before, after):
    return after.support.inside & ~before.support.inside


def test_a_bay_is_closed_as_the_face_goes_on():
    before = measured(bay)
    after = beyond_outline(before, nothing)
    new = added(before, after)
    X, Y = np.meshgrid(before.support.xs, before.support.ys)
    assert new[bay(X, Y)].mean() > 0.2
    true = height(before.support.xs, before.support.ys)
    error = np.abs(after.values[0] - true)[new]
    assert error.mean() < 0.4
    assert error.max() < 4
    same = before.support.inside
    np.testing.assert_array_equal(after.values[:, same], before.values[:, same])


def test_it_joins_without_a_step():
    before = measured(bay)
    after = beyond_outline(before, nothing)
    both, new = after.support.inside, added(before, after)
    for axis in (0, 1):
        joint = np.diff(new.astype(int), axis=axis) != 0
        joint &= np.logical_and(*(np.take(both, range(start, both.shape[axis] - 1 + start), axis)
                                  for start in (0, 1)))
        slope = np.abs(np.diff(after.values[0], axis=axis)[joint]) / before.support.step
        assert np.percentile(slope, 95) < 3


def test_it_goes_no_farther_than_a_few_millimetres():
    before = measured(lower)
    after = beyond_outline(before, nothing)
    lowest, before_it = (before.support.ys[np.nonzero(one.support.inside)[0].max()]
                         for one in (after, before))
    assert before_it + 1 < lowest < before_it + 5 + 2 * SPACING


def test_where_something_was_read_there_is_no_more_face():
    before = measured(bay)
    assert beyond_outline(before, lambda points: points[:, 2] + 50) is before
    left = beyond_outline(before, lambda points: np.where(points[:, 0] < 0, 0, points[:, 2] + 50))
    X, _ = np.meshgrid(before.support.xs, before.support.ys)
    new = added(before, left)
    assert new[X < -3].any()
    assert not new[X > 3].any()


def test_no_tongue_is_added():
    before = measured(lower)
    after = beyond_outline(before, lambda points: 900 * (np.abs(points[:, 0]) >= 1.5))
    assert not added(before, after).any()


@pytest.mark.parametrize("shape", [
    lambda xs, ys: AT_MM + 12 * np.sin(xs / 5) + 0 * ys[:, None],
    lambda xs, ys: AT_MM + 8 * np.abs(xs) + 0 * ys[:, None],
], ids=["waves", "edge"])
def test_what_is_no_face_is_left_as_it_is(shape):
    before = measured(bay, shape)
    assert beyond_outline(before, nothing) is before
