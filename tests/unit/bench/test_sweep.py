import numpy as np
import pytest

from bench.sweep import Band, bands


def test_bands_lie_between_their_edges():
    assert bands((-20, 0, 20), "degrees") == {
        "-20 to 0 degrees": (-20, 0), "0 to 20 degrees": (0, 20)}


def test_a_frame_counts_once_and_a_hole_by_its_points():
    band = Band()
    band.add(np.array([1.0, 1.0, 7.0, np.nan]), np.array([False, True, True, True]), 0.9)
    band.add(np.full(100, 1.0), np.zeros(100, bool), 1.0)
    # Means 3 and 1, squares 17 and 1: SD over both frames alike.
    assert band.row("x") == "| x | 2 | 2.00 | 2.24 | 16.67 | 95.0 | 90.0 | 4.00 |"


def test_the_spread_is_that_of_the_points():
    errors = np.random.default_rng(0).uniform(0, 2, 1000)
    band = Band()
    band.add(errors, np.zeros(1000, bool), 1.0)
    assert float(band.row("x").split("|")[4]) == pytest.approx(errors.std(), abs=0.006)


def test_an_empty_band_has_no_figures():
    assert Band().row("far") == "| far | 0 | - | - | - | - | - | - |"


def test_holes_that_are_mostly_left_open_have_no_error():
    band = Band()
    band.add(np.array([1.0, 2.0, np.nan, np.nan]), np.array([False, True, True, True]), 1.0)
    assert band.row("x").endswith("| - |")
