"""A hole is filled by what bends least between its borders, along the surface and not along z."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from denseface.recon.detail._holes import fill_holes
from denseface.recon.detail._rim import Rim

SPACING, STEP, CELLS = 1.5, 0.75, 40
# Where the cells are, and the points, mm.
CELL_Y, CELL_X = (np.mgrid[:CELLS, :CELLS] - 19.5) * 2 * SPACING
Y, X = (np.mgrid[:4 * CELLS, :4 * CELLS] - (2 * CELLS - 0.5)) * STEP
INSIDE = np.hypot(X, Y) < 50


def filled(shape, hole_mm, off_mm=0.0, noise_mm=0.0):
    """Fill a round hole: the heights' error, how much is filled, how much is missing."""
    counts = np.where(np.hypot(CELL_X, CELL_Y) < hole_mm, 0, 4).astype(np.float32)
    noise = np.random.default_rng(0).normal(0, noise_mm / 2, counts.shape)
    sums = counts * (shape(CELL_X, CELL_Y) + noise)
    missing = np.clip((hole_mm - np.hypot(X, Y)) / SPACING, 0, 1).astype(np.float32)
    # In the hole a broad average tells how steep it is.
    true = shape(X, Y).astype(np.float32)
    broad = gaussian_filter(true, 8 / STEP) + np.float32(off_mm)
    detail = true + missing * (broad - true)
    rim = Rim.of(INSIDE, STEP / SPACING)
    found, hole = fill_holes(
        counts, sums.astype(np.float32), missing, rim, 0 * true, detail, SPACING)
    return found + (1 - hole) * detail - true, hole, missing


def plane(x, y):
    return 0.7 * x - 0.2 * y


def chin(x, y):
    """Level above, steep below, a round edge between."""
    radius, slope = 14.0, 2.2
    end = radius * slope / np.hypot(1, slope)
    turned = np.clip(y + end / 2, 0, end)
    return radius - np.sqrt(radius**2 - turned**2) + slope * np.maximum(y - end / 2, 0)


def test_a_plane_goes_on_through_a_hole():
    error, hole, missing = filled(plane, 14)
    np.testing.assert_array_equal(hole, missing)
    np.testing.assert_allclose(error[hole > 0], 0, atol=0.01)


def test_the_first_guess_tells_slopes_alone():
    one, hole, _ = filled(plane, 14, off_mm=3.0)
    other, _, _ = filled(plane, 14)
    np.testing.assert_allclose(one[hole == 1], other[hole == 1], atol=0.01)


@pytest.mark.parametrize("hole_mm", [10, 12, 14])
def test_an_edge_is_not_cut_off(hole_mm):
    """Where all is nearly level, it is a thin plate, which spreads the turn evenly."""
    error, hole, _ = filled(chin, hole_mm)
    plate, _, _ = filled(lambda x, y: chin(x, y) / 100, hole_mm)
    deep = hole == 1
    assert np.abs(error[deep]).mean() < 0.75 * np.abs(100 * plate[deep]).mean()


@pytest.mark.parametrize("shape", [plane, chin])
def test_noise_at_the_border_is_smoothed(shape):
    clean, hole, _ = filled(shape, 10)
    error, _, _ = filled(shape, 10, noise_mm=1.2)
    assert np.abs((error - clean)[hole > 0]).mean() < 0.6


def test_where_no_hole_is_nothing_is_filled():
    for hole_mm in (0.0, 1.0):
        _, hole, _ = filled(plane, hole_mm)
        assert not hole.any()


def test_a_hole_at_the_rim_is_none():
    """What is missing there is past the rim."""
    counts = np.full(CELL_X.shape, 4, np.float32)
    missing = np.clip((np.hypot(X, Y) - 48.5) / SPACING, 0, 1).astype(np.float32)
    none = np.zeros(X.shape, np.float32)
    rim = Rim.of(INSIDE, STEP / SPACING)
    found, hole = fill_holes(counts, 0 * counts + 1, missing, rim, none, none, SPACING)
    assert not hole.any()
    assert not found.any()


def test_rows_and_columns_are_alike():
    def ridge(x, y):
        return 3 * np.sin(x / 9)

    one, hole, _ = filled(ridge, 12)
    other, _, _ = filled(lambda x, y: ridge(y, x), 12)
    np.testing.assert_allclose(other, one.T, atol=1e-3)
    assert hole.any()
