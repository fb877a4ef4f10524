import numpy as np
import pytest

from recon._segment_kernels import connect, nearest_to, row_medians, within, within_reach

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


def seen_at(count):
    """Where the pixels of a square image are seen: 3 apart, from (-10, 40)."""
    row, column = np.mgrid[:count, :count]
    return np.dstack([3 * column - 10, 3 * row + 40]).astype(np.float32)


def test_the_reach_is_a_superellipse():
    pixels = seen_at(81)
    (u, v), (side, up, down) = (100.0, 150.0), (75, 60, 100)
    valid = pixels[..., 0] < 150
    inside = within_reach(valid, pixels, (u, v), np.array((side, up, down), np.float32))
    below = pixels[..., 1] - v
    expected = (np.abs((pixels[..., 0] - u) / side) ** 2.5
                + np.abs(below / np.where(below < 0, up, down)) ** 2.5)
    clear = np.abs(expected - 1) > 1e-3
    np.testing.assert_array_equal(inside[clear], ((expected < 1) & valid)[clear])


def test_a_square_is_as_wide_as_it_is_high():
    pixels = seen_at(40)
    among = np.random.default_rng(0).random((40, 40)) < 0.7
    expected = among & (np.abs(pixels - (51, 90)) < 25).all(axis=2)
    assert expected.any()
    np.testing.assert_array_equal(within(among, pixels, (51.0, 90.0), 25.0), expected)


def test_the_nearest_is_one_that_is_seen():
    pixels = seen_at(40)
    rng = np.random.default_rng(1)
    among, visible = rng.random((2, 40, 40)) < 0.3
    away = np.where(among & visible, np.hypot(*(pixels - (51.3, 90.1)).transpose(2, 0, 1)), np.inf)
    assert nearest_to(among, visible, pixels, (51.3, 90.1)) == divmod(int(away.argmin()), 40)
    assert nearest_to(among, np.zeros_like(among), pixels, (51.3, 90.1)) == (-1, -1)


def test_each_second_of_the_rows_that_hold_some_has_a_median():
    rng = np.random.default_rng(2)
    z = rng.normal(700, 20, (12, 9)).astype(np.float32)
    among = rng.random((12, 9)) < 0.6
    among[[0, 5]] = False
    rows, medians = row_medians(z, among, 2)
    held = np.flatnonzero(among.any(axis=1))[::2]
    np.testing.assert_array_equal(rows, held)
    np.testing.assert_allclose(medians, [np.median(z[row][among[row]]) for row in held])
