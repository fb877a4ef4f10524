"""Stage 6 on surfaces that are known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from denseface.recon.noise import least_risk
from denseface.recon.openings import openings
from denseface.recon.propagation import densify
from denseface.recon.surface import exact_spacing
from denseface.service.export.mesh import triangulate
from tests.mesh_holes import mesh_faults
from tests.unit.recon.shapes import NOISE, disc_seeds, fitted, seeds

PLAN = least_risk(NOISE, 1.3, None, 6.0, 0.1)


def dense_of(points, ratio=10.0, colors=None, smoothing=0.1):
    spacing = exact_spacing(np.ascontiguousarray(points[:, :2]))
    surface = fitted(points, spacing, 6 * spacing, smoothing)
    return densify(seeds(points, colors), surface, spacing, ratio, PLAN)


def raised(points, height):
    """Points at z = height(x, y)."""
    return np.column_stack([points[:, :2], height(*points[:, :2].T)]).astype(np.float32)


def plane(x, y):
    return 700 + 0.3 * x - 0.2 * y


def sphere(x, y):
    return 800 - np.sqrt(110.0**2 - x * x - y * y)


def cosine_to(dense, slope_x, slope_y):
    """Cosine between each normal and that of a surface of such slopes."""
    true = np.column_stack(np.broadcast_arrays(slope_x, slope_y, -np.ones(len(dense))))
    return (dense.normals * true).sum(axis=1) / np.linalg.norm(true, axis=1)


@settings(deadline=None, max_examples=25)
@given(spacing=st.floats(0.8, 3.5), hole=st.floats(0, 0.6), jitter=st.floats(0, 0.4),
       missing=st.floats(0, 0.5), seed=st.integers(0, 99))
def test_about_ten_points_for_each_seed(spacing, hole, jitter, missing, seed):
    points = disc_seeds(spacing, 18 * spacing, hole * 18 * spacing, seed=seed, jitter=jitter)
    points = points[np.random.default_rng(seed).random(len(points)) >= missing]
    dense = dense_of(raised(points, plane))
    assert 8 <= len(dense) / len(points) <= 11


@pytest.mark.parametrize("ratio", [1, 4, 25])
def test_the_ratio_is_what_is_asked_for(ratio):
    points = raised(disc_seeds(1.3, 40, 8), plane)
    assert len(dense_of(points, ratio)) / len(points) == pytest.approx(ratio, rel=0.08)


def test_the_points_lie_on_their_grid_and_their_cells_are_sorted():
    dense = dense_of(raised(disc_seeds(1.3, 40, 8), sphere))
    rows, columns = dense.grid_shape
    flat = dense.cells[:, 0].astype(int) * columns + dense.cells[:, 1]
    assert (np.diff(flat) > 0).all()
    assert dense.cells.min() >= 0
    assert (dense.cells.max(axis=0) < (rows, columns)).all()
    origin = dense.points[0, :2] - dense.cells[0, ::-1] * dense.grid_step_mm
    np.testing.assert_allclose(
        dense.points[:, :2], origin + dense.cells[:, ::-1] * dense.grid_step_mm, atol=1e-4)


def test_a_plane_stays_one():
    dense = dense_of(raised(disc_seeds(1.3, 40, 10), plane))
    np.testing.assert_allclose(dense.points[:, 2], plane(*dense.points[:, :2].T), atol=1e-3)
    assert cosine_to(dense, 0.3, -0.2).min() > 1 - 1e-6


def test_a_sphere_stays_one():
    dense = dense_of(raised(disc_seeds(1.3, 60), sphere))
    x, y, z = dense.points.T.astype(float)
    away = np.hypot(x, y)
    assert np.abs(z - sphere(x, y)).max() < 0.2
    assert np.abs(z - sphere(x, y))[away < 50].max() < 0.01
    lower = 800 - sphere(x, y)
    cosine = cosine_to(dense, x / lower, y / lower)
    assert cosine.min() > 0.99
    assert cosine[away < 50].min() > 0.9999


def test_normals_are_of_unit_length_and_toward_the_camera():
    rng = np.random.default_rng(0)
    points = raised(disc_seeds(1.5, 35, 6), sphere)
    points[:, 2] += rng.normal(0, 2, len(points))
    dense = dense_of(points)
    np.testing.assert_allclose(np.linalg.norm(dense.normals, axis=1), 1, atol=1e-6)
    assert (dense.normals[:, 2] < 0).all()


def test_a_hole_is_filled_with_the_surface_around_it():
    dense = dense_of(raised(disc_seeds(1.3, 50, 12), sphere), smoothing=1)
    x, y, z = dense.points.T.astype(float)
    hole = np.hypot(x, y) < 11
    assert hole.sum() == pytest.approx(np.pi * 11**2 / dense.grid_step_mm**2, rel=0.03)
    assert np.abs(z - sphere(x, y))[hole].max() < 1


def test_the_colours_of_two_sides_stay_on_theirs():
    points = raised(disc_seeds(1.3, 40, 8), sphere)
    left, right = (210, 150, 120), (40, 70, 200)
    dense = dense_of(points, colors=np.where(points[:, :1] < 0, left, right).astype(np.uint8))
    hole = np.hypot(*dense.points[:, :2].T) < 10
    x = dense.points[:, 0]
    assert (dense.colors[(x < -4) & ~hole] == left).all()
    assert (dense.colors[(x > 4) & ~hole] == right).all()
    assert (np.abs(dense.colors[hole & (x < -4)].astype(int) - left).max(axis=1) < 60).all()


def test_arrays_are_of_the_documented_kinds():
    dense = dense_of(raised(disc_seeds(1.3, 30), plane))
    assert dense.points.dtype == dense.normals.dtype == np.float32
    assert dense.colors.dtype == np.uint8
    assert dense.cells.dtype == np.int32
    assert dense.grid_step_mm < 1.3


def test_points_in_a_hole_are_coloured_by_what_is_seen_there():
    points = raised(disc_seeds(1.3, 40, 8), sphere)
    spacing = exact_spacing(points[:, :2])
    surface = fitted(points, spacing, 8 * spacing, 0.1)
    asked = []

    def sampler(some):
        asked.append(some)
        return np.full((len(some), 3), (10, 20, 30), np.uint8), some[:, 0] > 0

    dense = densify(seeds(points), surface, spacing, 10, PLAN, sampler)
    far, _ = cKDTree(points[:, :2]).query(dense.points[:, :2])
    inside = far > 2 * spacing
    assert len(asked[0]) >= inside.sum() > 100
    assert np.hypot(*asked[0][:, :2].T).max() < 8
    right = dense.points[:, 0] > 0
    assert (dense.colors[inside & right] == (10, 20, 30)).all()
    # What the camera does not see there is filled from the border.
    assert (dense.colors[inside & ~right] == 128).all()
    assert (dense.colors[far < spacing] == 128).all()


@pytest.mark.parametrize("ratio", [1, 10, 40])
def test_colours_stand_where_their_seeds_are(ratio):
    """However coarse the colours' own grid: a ramp of colours keeps its place."""
    points = raised(disc_seeds(1.3, 40), plane)
    ramp = np.rint(128 + 2.5 * points[:, :2]).astype(np.uint8)
    dense = dense_of(points, ratio, colors=np.column_stack([ramp, ramp[:, 0]]))
    inner = np.hypot(*dense.points[:, :2].T) < 36
    off = dense.colors[inner, :2] - (128 + 2.5 * dense.points[inner, :2])
    assert np.abs(off.mean(axis=0)).max() < 0.3
    assert np.abs(off).max() < 4


def test_a_step_is_not_bridged_where_nothing_was_read():
    """Two halves, four spacings apart and 40 mm deeper on the right."""
    points = disc_seeds(1.0, 30)
    points = points[np.abs(points[:, 0]) > 1.8]
    points[:, 2] = np.where(points[:, 0] > 0, 740, 700)
    dense = densify(seeds(points), fitted(points, 1.0, 4, 0.1), 1.0, 10, PLAN)
    x, y, z = dense.points.T
    assert not ((np.abs(x) < 1) & (np.abs(y) < 28)).any()
    # Neither side loses its own.
    for side, depth in ((x < -3, 700), (x > 3, 740)):
        assert side.sum() == pytest.approx(10 * (np.abs(points[:, 0]) > 3).sum() / 2, rel=0.1)
        assert np.abs(z[side] - depth).mean() < 2


@pytest.mark.parametrize(("step_mm", "stays_open"), [(20, False), (60, True)])
def test_an_enclosed_bridge_closes_a_nose_s_side_but_joins_no_two_surfaces(step_mm, stays_open):
    """A plateau before a plane, nothing read for 3.6 mm on one side; it slopes down elsewhere."""
    points = disc_seeds(1.0, 30)
    x, y, _ = points.T
    points = points[~((np.abs(x) < 1.8) & (np.abs(y) < 8))]
    x, y, _ = points.T
    steep = np.clip(x / 2 + 0.5, 0, 1) * np.clip(1.5 - np.abs(y) / 12, 0, 1)
    points[:, 2] = 700 + step_mm * np.where(x > 0, steep * np.clip(1.5 - x / 14, 0, 1), 0)
    dense = densify(seeds(points), fitted(points, 1.0, 4, 0.1), 1.0, 10, PLAN)
    found = openings(dense)
    assert (found.holes > 0) == stays_open
    assert mesh_faults(dense.points, triangulate(dense)).holes == found.holes


def test_a_gap_without_a_step_is_filled():
    points = disc_seeds(1.0, 30)
    points = points[np.abs(points[:, 0]) > 1.8]
    dense = densify(seeds(points), fitted(points, 1.0, 4, 0.1), 1.0, 10, PLAN)
    x, y, _ = dense.points.T
    assert ((np.abs(x) < 1.5) & (np.abs(y) < 28)).sum() == pytest.approx(
        3 * 56 / dense.grid_step_mm**2, rel=0.1)


def test_what_was_read_stays_however_steep():
    points = disc_seeds(1.0, 30)
    points[:, 2] = 700 + 8 * points[:, 0]
    dense = densify(seeds(points), fitted(points, 1.0, 8, 0.1), 1.0, 10, PLAN)
    read, _ = cKDTree(dense.points[:, :2]).query(points[:, :2])
    assert np.quantile(read, 0.9) < 0.5
