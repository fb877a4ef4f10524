"""Near the rim averages are broad, carry slopes on to it, and a frayed edge gets its depth back."""

import numpy as np
import pytest

from denseface.recon.detail._rim import Rim, iterated_average

ROWS, COLUMNS, FINER = 40, 50, 4
USUAL = 4.0
# Where the cells are, and the points of the finer grid, in cells.
CELL_X = (np.mgrid[:ROWS, :COLUMNS][1] + 0.5).astype(np.float32)
Y, X = ((np.mgrid[:FINER * ROWS, :FINER * COLUMNS] + 0.5) / FINER).astype(np.float32)
FULL = np.full((ROWS, COLUMNS), USUAL, np.float32)


def averaged(shown, seeds=FULL, away=10.0):
    """Average what each cell shows, known only where there are seeds, far from the rim or near."""
    rim = Rim(np.ones_like(X), np.full(X.shape, away, np.float32))
    return iterated_average(seeds, (seeds * shown).astype(np.float32), 3.0, USUAL, rim, FINER)


def frayed(support, slopes, spacing, step):
    """What is added, on every other point of each direction."""
    rim = Rim.of(support, step / spacing)
    dz_dx, dz_dy = (one[::2, ::2].astype(np.float32) for one in slopes)
    return rim.fraying_correction(dz_dx, dz_dy, spacing)


def test_nothing_stays_nothing():
    assert not averaged(0 * CELL_X).any()


def test_noise_goes_and_a_broad_shape_stays():
    noise = np.random.default_rng(0).normal(size=FULL.shape)
    assert averaged(noise)[40:-40, 40:-40].std() < 0.25
    found = averaged(np.sin(CELL_X / 8))
    np.testing.assert_allclose(found[40:-40, 60:-60], np.sin(X / 8)[40:-40, 60:-60], atol=0.05)


def test_at_the_rim_more_of_a_slope_is_left():
    """Seeds right of the middle alone; the slope goes on to their rim."""
    seeds = np.where(CELL_X > 25, FULL, 0)
    rim = (X > 25) & (X < 26) & (Y > 10) & (Y < 30)
    off = {away: np.abs(averaged(CELL_X - 25, seeds, away) - (X - 25))[rim].mean()
           for away in (0, 10)}
    assert off[0] < 0.7 * off[10]
    assert off[10] < 1


def test_the_broad_average_counts_near_the_rim_alone():
    away = np.array([[-1, 0, 2.9, 5.5, 8.1, 50]], np.float32)
    np.testing.assert_allclose(Rim(away, away).broad_weight, [[1, 1, 1, 0.5, 0, 0]], atol=1e-5)


def test_the_rim_is_as_far_as_the_outline():
    support = np.zeros((120, 161), bool)
    support[20:, 40:120] = True
    rim = Rim.of(support, 0.25)
    assert rim.distance.shape == rim.coverage.shape == (60, 81)
    np.testing.assert_allclose(
        rim.distance[40, [20, 22, 39, 40, 59]], [0.25, 1.25, 9.75, 9.75, 0.25], atol=0.05)
    assert (rim.distance[~support[::2, ::2]] < 0).all()
    np.testing.assert_allclose(rim.coverage[40, [19, 20]].mean(), 0.5, atol=0.01)


@pytest.mark.parametrize("spacing", [1.0, 2.0])
def test_a_dome_gets_deeper_toward_its_rim(spacing):
    step, radius = spacing / 4, 30 * spacing
    y, x = (np.mgrid[:300, :300] - 149.5) * step
    far = np.hypot(x, y)
    support = far < radius
    away = (radius - far)[::2, ::2] / spacing
    found = frayed(support, (x / radius, y / radius), spacing, step)
    over = support[::2, ::2]
    assert not found[away > 4.5].any()
    assert found[over].min() >= 0
    edge = over & (away < 0.4)
    np.testing.assert_allclose(found[edge], 0.55 * spacing, rtol=0.15)
    # Where the surface comes nearer toward its rim, or is flat, nothing is known of it.
    assert not frayed(support, (-x / radius, -y / radius), spacing, step)[over].any()
    assert not frayed(support, (0 * x, 0 * y), spacing, step)[over].any()


def test_a_wall_counts_no_more_than_a_slope():
    support = np.pad(np.ones((120, 120), bool), 10)
    x = np.mgrid[:140, :140][1] - 69.5
    found = [frayed(support, (np.sign(x) * slope, 0 * x), 1.0, 0.5) for slope in (1.5, 20)]
    np.testing.assert_allclose(found[0][25:-25], found[1][25:-25], atol=1e-6)
    assert found[0][25:-25].max() > 0.5


def test_a_colour_is_the_face_s_own_within_the_rim():
    away = np.array([[-1, 0.5, 1.5, 2.5, 50]], np.float32)
    np.testing.assert_allclose(Rim(np.ones_like(away), away).color_weight, [[0, 0, 0.5, 1, 1]])
