import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.recon.numerics.percentile import percentile


@given(st.lists(st.floats(-1e3, 1e3, width=32), min_size=1, max_size=60), st.floats(0, 100))
def test_it_is_numpys(values, percent):
    given = np.array(values, np.float32)
    expected = np.percentile(given.astype(np.float64), percent)
    assert percentile(given, percent) == pytest.approx(expected, abs=1e-3)
    np.testing.assert_array_equal(given, np.array(values, np.float32))


@pytest.mark.parametrize("values", [
    np.random.default_rng(1).normal(700, 5, 2000), np.repeat([700.0, 702.0, 704.0], 500),
    np.exp(np.random.default_rng(2).normal(0, 8, 1000)), np.full(400, 3.3), np.arange(1000.0)],
    ids=["noise", "levels", "far apart", "one", "even"])
def test_of_many_numbers_it_is_that_of_all_of_them(values):
    given = np.ascontiguousarray(np.stack([values, values], axis=1), np.float32)[:, 0]
    ordered = np.sort(given).astype(np.float64)
    for percent in (0, 2, 26, 50, 97.3, 100):
        place = (len(ordered) - 1) * percent / 100
        below = int(place)
        above = min(below + 1, len(ordered) - 1)
        assert percentile(given, percent) == (
            ordered[below] + (place - below) * (ordered[above] - ordered[below]))


@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_is_not_finite_ends_in_some_number():
    given = np.random.default_rng(3).normal(size=1000).astype(np.float32)
    given[[3, 500]] = np.nan, np.inf
    assert isinstance(percentile(given, 50), float)
