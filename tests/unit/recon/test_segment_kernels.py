import numpy as np
import pytest

from recon._segment_kernels import connect, within_reach

STEP, RISE, GAP, COVERED = 12.0, 25.0, 5, 12


def followed(z, hidden=(), wanted=None):
    """A row of depths, followed from its first pixel; as a string of what is found."""
    z = np.array([z], np.float32)
    cover = np.zeros(z.shape, bool)
    cover[0, list(hidden)] = True
    found = connect(z, z > 0 if wanted is None else wanted, cover, 0, 0, STEP, RISE, GAP, COVERED)
    return "".join(".x"[int(one)] for one in found[0])


@pytest.mark.parametrize(("z", "found"), [
    ([700, 711, 722, 733], "xxxx"),
    ([700, 711, 724, 733], "xx.."),
    ([700, 689, 678, 667], "xxx."),               # 667 is 33 mm nearer than the start
    ([700, 711, 722, 711, 700, 694], "xxxxx."),   # down into a valley and up again
    ([700, 0, 0, 0, 0, 703, 0], "x....x."),
    ([700, 0, 0, 0, 0, 0, 703], "x......"),
    ([700, 0, 0, 730, 0, 0, 700], "x......"),     # something measured is no gap
])
def test_a_surface_is_followed_by_small_steps_outward(z, found):
    assert followed(z) == found


def test_a_surface_goes_on_behind_what_covers_it():
    row = [700, *[640] * 8, 705]
    assert followed(row) == "x........."
    assert followed(row, range(1, 9)) == "x........x"
    assert followed([700, *[640] * 12, 705], range(1, 13)) == "x............."


def test_what_is_not_wanted_is_not_followed():
    z = np.full((1, 5), 700, np.float32)
    wanted = np.array([[True, True, False, True, True]])
    found = connect(z, wanted, np.zeros(z.shape, bool), 0, 0, STEP, RISE, GAP, COVERED)
    assert found.tolist() == [[True, True, False, False, False]]


def test_the_reach_is_a_superellipse():
    down, across = np.mgrid[-1:1:81j, -1:1:81j].astype(np.float32)
    inside = within_reach(across < 0.5, across, down, np.array((0.7, 0.5, 0.9), np.float32))
    reach = np.where(down < 0, 0.5, 0.9)
    expected = np.abs(across / 0.7) ** 2.5 + np.abs(down / reach) ** 2.5
    clear = np.abs(expected - 1) > 1e-3
    np.testing.assert_array_equal(inside[clear], ((expected < 1) & (across < 0.5))[clear])
