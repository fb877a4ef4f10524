import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.segmentation._depth_kmeans import split_depths


def spread(groups):
    return sum(((group - group.mean()) ** 2).sum() for group in groups if len(group))


@settings(deadline=None)
@given(st.lists(st.integers(400, 460), min_size=1, max_size=25))
def test_no_other_cuts_are_better(depths):
    z = np.sort(np.array(depths, np.float32))
    found = split_depths(z)
    assert found[0].first == z[0]
    assert found[-1].last == z[-1]
    groups = [z[(z >= cluster.first) & (z <= cluster.last)] for cluster in found]
    assert sum(map(len, groups)) == len(z)
    best = min(spread(np.split(z, cuts))
               for cuts in itertools.combinations_with_replacement(range(len(z) + 1), 2))
    assert spread(groups) <= best + 1e-3 * (1 + best)


def test_three_surfaces_are_told_apart():
    rng = np.random.default_rng(1)
    z = np.concatenate([rng.normal(mean, 5, n) for mean, n in
                        ((700, 9000), (900, 500), (3000, 4000))]).astype(np.float32)
    near, middle, far = split_depths(z)
    assert (near.last < 800 < middle.first, middle.last < 1500 < far.first) == (True, True)
    assert near.low == pytest.approx(700 - 2.05 * 5, abs=1)
    assert near.high == pytest.approx(700 + 2.05 * 5, abs=1)


def test_one_depth_is_one_cluster():
    only, = split_depths(np.full(7, 812.0, np.float32))
    assert only == (812, 812, 812, 812)


@pytest.mark.parametrize("off", [0.0, 0.25, 0.5, 0.75])
def test_parts_of_a_millimetre_are_rounded(off):
    z = np.repeat(np.float32([700, 702, 703]), 5) + np.float32(off)
    found = split_depths(z)
    whole = np.floor(z + 0.5).astype(int)
    assert (found[0].first, found[-1].last) == (whole.min(), whole.max())
    assert sum(((whole >= one.first) & (whole <= one.last)).sum() for one in found) == len(z)
