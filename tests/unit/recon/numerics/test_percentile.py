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
