"""Where a surface is supported: over the seeds and the holes they enclose."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from denseface.recon.numerics.bilinear import exceeds
from denseface.recon.numerics.morphology import binary_fill_holes
from denseface.recon.support import Support
from tests.unit.recon.shapes import disc_seeds


def supported(points, spacing, step=None):
    """The grid's points with support, (k, 2), those without, and their distance to a seed."""
    xs, ys, support = Support.of(points, spacing).on_grid(step or spacing / np.sqrt(10))
    grid = np.stack(np.meshgrid(xs, ys), axis=-1)
    return grid[support], grid[~support]


def to_seed(grid, points):
    return np.asarray(cKDTree(points[:, :2]).query(grid)[0])


@settings(deadline=None, max_examples=25)
@given(spacing=st.floats(0.8, 4), radius=st.floats(10, 25), hole=st.floats(0, 0.6),
       x=st.floats(-300, 300), y=st.floats(-300, 300), seed=st.integers(0, 99))
def test_covers_seeds_and_holes_but_no_rim(spacing, radius, hole, x, y, seed):
    """Radius in spacings, hole as a share of it."""
    radius, hole = radius * spacing, hole * radius * spacing
    points = disc_seeds(spacing, radius, hole, seed=seed) + np.float32((x, y, 0))
    inside, outside = supported(points, spacing)
    middle = np.hypot(*(inside - (x, y)).T)
    # Nothing past the rim: at most half a spacing beyond the outermost seeds.
    assert middle.max() <= radius + 0.5 * spacing
    assert to_seed(inside[middle > hole + spacing], points).max() <= 1.4 * spacing
    # The hole is filled, and nothing else is left out but the rim itself.
    assert np.hypot(*(outside - (x, y)).T).min() > radius - 1.5 * spacing


def test_a_bay_open_to_the_outside_is_no_hole():
    points = disc_seeds(1.0, 30)
    bay = (points[:, 0] > 0) & (np.abs(points[:, 1]) < 6)
    inside, _ = supported(points[~bay], 1.0)
    assert not ((inside[:, 0] > 5) & (np.abs(inside[:, 1]) < 4.5)).any()


@pytest.mark.parametrize("mouth", [3, 4, 5])
def test_a_bay_whose_mouth_closes_leaves_no_hole(mouth):
    """Evened out, a narrow mouth closes, and the bay behind it is enclosed."""
    points = disc_seeds(1.0, 30)
    bay = ((np.hypot(points[:, 0] - 14, points[:, 1]) < 6)
           | ((points[:, 0] > 14) & (np.abs(points[:, 1]) < mouth / 2)))
    for step in (0.5, 0.32):
        support = Support.of(points[~bay], 1.0).on_grid(step)[2].astype(np.uint8)
        np.testing.assert_array_equal(support, binary_fill_holes(support))


@pytest.mark.parametrize(("width", "stays"), [(4, False), (12, True)])
def test_a_tongue_goes_and_an_ear_stays(width, stays):
    head = disc_seeds(1.0, 40)
    ear = disc_seeds(1.0, 70)
    ear = ear[(np.abs(ear[:, 1]) < width / 2) & (ear[:, 0] > 35) & (ear[:, 0] < 58)]
    inside, _ = supported(np.concatenate([head, ear]), 1.0)
    assert inside[:, 0].max() > 55 if stays else inside[:, 0].max() < 46  # but for its root
    assert len(inside) * 0.1 > 0.97 * np.pi * 40**2


def test_a_narrow_bay_and_a_pin_hole_are_closed():
    points = disc_seeds(1.0, 40)
    x, y, _ = points.T
    bay = (x > 25) & (np.abs(y) < 2)
    pin = np.hypot(x + 10, y - 5) < 1.5
    whole, support = (Support.of(some, 1.0).on_grid(0.3)[2]
                      for some in (points, points[~bay & ~pin]))
    assert support.sum() == pytest.approx(whole.sum(), rel=0.005)  # of which the bay is 0.012
    np.testing.assert_array_equal(support, binary_fill_holes(support.astype(np.uint8)))


def test_a_cut_leaves_no_tongue_and_no_island():
    support = Support.of(disc_seeds(1.0, 40), 1.0)
    x = np.broadcast_to(support.xs, support.margin.shape)
    cut = support.cut((np.abs(x - 28) < 1) | (np.abs(x - 24) < 1))
    before, after = support.margin > support.level, cut.margin > cut.level
    assert before[x > 23].sum() > 2000
    assert not after[x > 23].any()
    assert (after != before)[x < 22].sum() < 30  # its corners


def test_two_parts_are_not_joined():
    parts = [disc_seeds(1.0, 12) + np.float32((x, 0, 0)) for x in (-15, 15)]
    inside, _ = supported(np.concatenate(parts), 1.0)
    assert not (np.abs(inside[:, 0]) < 2).any()
    assert (inside[:, 0] < -3).sum() > 3000
    assert (inside[:, 0] > 3).sum() > 3000


def roundness(points):
    """Perimeter squared over area, 1 for a circle."""
    support = Support.of(points, 1.0).on_grid(0.3)[2].astype(np.uint8)
    outlines, _ = cv2.findContours(support, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    perimeter = sum(cv2.arcLength(outline, True) for outline in outlines)
    return perimeter**2 / (4 * np.pi * support.sum())


def test_frayed_edges_are_evened_out():
    points = disc_seeds(1.0, 25, jitter=0)
    far, turn = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    frayed = points[(far < 22) | (np.sin(40 * turn) > 0)]
    assert roundness(points) < 1.2
    assert roundness(frayed) < 1.5
    inside, _ = supported(frayed, 1.0)
    assert to_seed(inside, frayed).max() < 2.2
    assert np.hypot(*inside.T).max() <= 25.4


def test_broad_bites_and_spurs_of_an_edge_are_evened_out():
    """An edge that is frayed over several pixels at once, by two spacings either way."""
    points = disc_seeds(1.0, 32, jitter=0)
    far, turn = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    frayed = points[far < 28 + 2 * np.sign(np.sin(30 * turn))]
    inside, outside = supported(frayed, 1.0)
    assert roundness(frayed) < 1.2
    assert np.hypot(*inside.T).max() < 29
    assert np.hypot(*outside.T).min() > 27


@pytest.mark.parametrize("sides", [(7, 8), (3, 17), (2, 26)])
def test_few_seeds_still_have_support(sides):
    x, y = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in sides))
    points = np.stack([x, y, 700 + 0 * x], axis=-1).reshape(-1, 3)
    inside, _ = supported(points, 1.0)
    assert len(inside) > 0.5 * 10 * len(points)
    middle = np.array([np.median(x), np.median(y)])
    assert np.hypot(*(inside - middle).T).min() < 0.3
    assert to_seed(inside, points).max() < 1.2


def test_the_grid_is_regular_and_its_border_empty():
    points = disc_seeds(1.5, 20)
    xs, ys, support = Support.of(points, 1.5).on_grid(0.5)
    np.testing.assert_allclose(np.diff(xs), 0.5)
    np.testing.assert_allclose(np.diff(ys), 0.5)
    assert support.shape == (len(ys), len(xs))
    assert not support[[0, -1]].any()
    assert not support[:, [0, -1]].any()


def test_both_grids_agree_and_the_area_is_that_of_the_disc():
    support = Support.of(disc_seeds(1.3, 40), 1.3)
    _, _, inside = support.on_grid(0.4)
    area = inside.sum() * 0.4**2
    assert support.area == pytest.approx(area, rel=0.02)
    assert area == pytest.approx(np.pi * 40**2, rel=0.05)
    columns, rows = support.coordinates(support.xs, support.ys)
    np.testing.assert_array_equal(
        support.inside, exceeds(support.margin, rows, columns, 0.0))


def test_what_is_removed_is_below_both_levels():
    rng = np.random.default_rng(2)
    margin = rng.normal(size=(9, 13)).astype(np.float32)
    removed = rng.random((9, 13)) < 0.5
    found = Support(np.arange(13.0), np.arange(9.0), 1.0, np.zeros((9, 13), np.uint8), margin,
                    0.3).without(removed).margin
    np.testing.assert_array_equal(found[~removed], margin[~removed])
    level = np.float32(0.3)
    np.testing.assert_allclose(
        found[removed], np.minimum(level - np.abs(margin[removed] - level), 0), atol=1e-6)


def test_what_is_removed_ends_half_way_to_the_next_point():
    support = Support.of(disc_seeds(1.0, 20), 1.0)
    removed = np.zeros(support.inside.shape, bool)
    middle = np.argmin(np.abs(support.ys)), np.argmin(np.abs(support.xs))
    removed[middle[0] - 2:middle[0] + 3, middle[1] - 2:middle[1] + 3] = True
    without = support.without(removed)
    np.testing.assert_array_equal(without.inside, support.inside & ~removed)
    step = 0.02
    _, _, inside = without.on_grid(step)
    _, _, before = support.on_grid(step)
    gone = np.argwhere(before & ~inside) * step
    np.testing.assert_allclose(np.ptp(gone, axis=0), 5 * support.step, atol=0.1)


def test_what_is_near_a_seed():
    """To half a point of the grid each way, by which a seed may be beside its point."""
    points = disc_seeds(2.0, 20.0, 10.0)
    found = Support.of(points, 2.0)
    away = to_seed(np.stack(np.meshgrid(found.xs, found.ys), axis=-1), points)
    near = found.near_seeds(3.0)
    beside = found.step / np.sqrt(2)
    assert near[away < 3 - 2 * beside].all()
    assert not near[away > 3 + beside].any()
    assert 0 < near.mean() < 1
