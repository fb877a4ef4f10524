import numpy as np
import pytest

from bench.tally import HEADINGS, Tally

NAN = np.nan


def test_counts_what_a_method_gives_and_what_it_leaves_out():
    tally = Tally("a method")
    tally.add(np.array([1.0, 3.0, 6.0, NAN]), np.array([False, True, True, True]),
              np.array([0.5, 0.5, 2.0, 9.0]), 12.0)
    assert tally.mean_mm == pytest.approx(10 / 3)
    assert tally.ours == [1.0]  # where the method gives nothing, ours does not count
    assert tally.hole_mm == pytest.approx(4.5)
    assert tally.counts.sum() == 2  # of three points one lies beyond Figure 9
    assert tally.row() == "| a method | 3.33 | 1.00 | 4.50 | 67 | 33.33 | 75.0 | 12.0 |"
    assert tally.row().count("|") == len(HEADINGS) + 1


def test_a_frame_counts_once_in_the_mean_and_a_point_once_in_holes():
    tally = Tally("a method")
    tally.add(np.full(10, 1.0), np.ones(10, bool), None, 1.0)
    tally.add(np.full(2, 2.0), np.ones(2, bool), None, 3.0)
    assert tally.mean_mm == 1.5
    assert tally.hole_mm == pytest.approx(14 / 12)
    assert tally.median_ms == 2.0


def test_holes_that_are_mostly_left_open_have_no_error():
    tally = Tally("a method")
    tally.add(np.array([1.0, 2.0, NAN, NAN]), np.array([False, True, True, True]), None, 1.0)
    assert tally.hole_mm is None
    assert "| - | 33 |" in tally.row()
