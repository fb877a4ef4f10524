import numpy as np
import pytest

from bench.error_summary import HEADINGS, ErrorSummary

NAN = np.nan


def test_counts_what_a_method_gives_and_what_it_leaves_out():
    summary = ErrorSummary("a method")
    summary.add(np.array([1.0, 3.0, 6.0, NAN]), np.array([False, True, True, True]),
              np.array([0.5, 0.5, 2.0, 9.0]), 12.0)
    assert summary.mean_mm == pytest.approx(10 / 3)
    assert summary.ours == [1.0]  # where the method gives nothing, ours does not count
    assert summary.hole_mm == pytest.approx(4.5)
    assert summary.counts.sum() == 2  # of three points one lies beyond Figure 9
    assert summary.row() == "| a method | 3.33 | 1.00 | 4.50 | 67 | 33.33 | 75.0 | 12.0 |"
    assert summary.row().count("|") == len(HEADINGS) + 1


def test_a_frame_counts_once_in_the_mean_and_a_point_once_in_holes():
    summary = ErrorSummary("a method")
    summary.add(np.full(10, 1.0), np.ones(10, bool), None, 1.0)
    summary.add(np.full(2, 2.0), np.ones(2, bool), None, 3.0)
    assert summary.mean_mm == 1.5
    assert summary.hole_mm == pytest.approx(14 / 12)
    assert summary.median_ms == 2.0


def test_holes_that_are_mostly_left_open_have_no_error():
    summary = ErrorSummary("a method")
    summary.add(np.array([1.0, 2.0, NAN, NAN]), np.array([False, True, True, True]), None, 1.0)
    assert summary.hole_mm is None
    assert "| - | 33 |" in summary.row()
