import numpy as np
import pytest

from denseface.recon.segmentation._region_kernels import (
    FloodLimits,
    nearest_pixel,
    principal_axis,
    priority_flood,
    row_medians,
    square_mask,
    superellipse_mask,
    trim_below_drop,
    trim_beside_rise,
    trim_to_profile,
)

LIMITS = FloodLimits(step=12.0, rise=25.0, gap=5, occluded_gap=12)


def flooded(z, occluded=()):
    """A row of depths, flooded from its first pixel: the region as a string."""
    z = np.array([z], np.float32)
    mask = np.zeros(z.shape, bool)
    mask[0, list(occluded)] = True
    found = priority_flood(z, z > 0, mask, (0, 0), LIMITS)
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
def test_a_region_grows_by_small_steps_outward(z, found):
    assert flooded(z) == found


def test_a_region_goes_on_behind_what_occludes_it():
    row = [700, *[640] * 8, 705]
    assert flooded(row) == "x........."
    assert flooded(row, range(1, 9)) == "x........x"
    assert flooded([700, *[640] * 12, 705], range(1, 13)) == "x............."


def test_what_is_no_candidate_is_not_of_the_region():
    z = np.full((1, 5), 700, np.float32)
    candidates = np.array([[True, True, False, True, True]])
    found = priority_flood(z, candidates, np.zeros(z.shape, bool), (0, 0), LIMITS)
    assert found.tolist() == [[True, True, False, False, False]]


def seen_at(count):
    """Where the pixels of a square image are seen: 3 apart, from (-10, 40)."""
    row, column = np.mgrid[:count, :count]
    return np.dstack([3 * column - 10, 3 * row + 40]).astype(np.float32)


def test_the_mask_is_a_superellipse():
    pixels = seen_at(81)
    (u, v), (side, up, down) = (100.0, 150.0), (75, 60, 100)
    valid = pixels[..., 0] < 150
    inside = superellipse_mask(valid, pixels, (u, v), np.array((side, up, down), np.float32))
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
    np.testing.assert_array_equal(square_mask(among, pixels, (51.0, 90.0), 25.0), expected)


def test_the_nearest_is_one_that_is_seen():
    pixels = seen_at(40)
    rng = np.random.default_rng(1)
    among, visible = rng.random((2, 40, 40)) < 0.3
    away = np.where(among & visible, np.hypot(*(pixels - (51.3, 90.1)).transpose(2, 0, 1)), np.inf)
    assert nearest_pixel(among, visible, pixels, (51.3, 90.1)) == divmod(int(away.argmin()), 40)
    assert nearest_pixel(among, np.zeros_like(among), pixels, (51.3, 90.1)) == (-1, -1)


def test_each_second_of_the_rows_that_hold_some_has_a_median():
    rng = np.random.default_rng(2)
    z = rng.normal(700, 20, (12, 9)).astype(np.float32)
    among = rng.random((12, 9)) < 0.6
    among[[0, 5]] = False
    rows, medians = row_medians(z, among, 2)
    held = np.flatnonzero(among.any(axis=1))[::2]
    np.testing.assert_array_equal(rows, held)
    np.testing.assert_allclose(medians, [np.median(z[row][among[row]]) for row in held])


@pytest.mark.parametrize("degrees", [-60, -20, 0, 35, 80])
def test_the_principal_axis_is_that_of_an_ellipse(degrees):
    row, column = np.mgrid[-60:60, -70:80]
    down, right = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    along, across = down * row + right * column, right * row - down * column
    np.testing.assert_allclose(principal_axis((along / 45) ** 2 + (across / 30) ** 2 < 1),
                               (down, right), atol=0.01)


def test_without_a_longer_way_the_axis_points_down():
    assert principal_axis(np.ones((9, 9), bool)) == (1.0, 0.0)


def test_depth_is_trimmed_downward_or_along_the_axis_whichever_is_farther():
    pixels = seen_at(60)
    z = np.full((60, 60), 750, np.float32)
    middle, axis = (80.0, 130.0), (np.cos(0.5), np.sin(0.5))
    face = np.ones(z.shape, bool)
    # 50 mm behind the front are allowed up to 10 below.
    trim_to_profile(face, z, pixels, 700.0, middle, axis,
                    (np.array((0.0, 20.0)), np.array((100.0, 0.0))))
    u, v = (pixels - middle).transpose(2, 0, 1)
    np.testing.assert_array_equal(face, np.maximum(v, axis[0] * v + axis[1] * u) < 10)


def stepped(drop_mm, *, gap=0, at=12):
    """A chin before a neck, as wide as the image, seen from row 2, column 10."""
    z = np.full((24, 21), 700, np.float32)
    z[at:] += drop_mm
    face = np.ones(z.shape, bool)
    face[at:at + gap] = False
    trim_below_drop(face, z, (2, 10), 5, 30.0, 4)
    return face


def test_what_lies_behind_a_step_down_is_dropped_on_straight_rays_alone():
    row, column = np.mgrid[:24, :21]
    beside = np.abs(column - 10) > row - 2
    np.testing.assert_array_equal(stepped(40), (row < 12) | beside)
    assert stepped(25).all()


def test_a_step_counts_below_the_start_and_over_a_narrow_gap():
    assert stepped(40, at=6).all()
    assert not stepped(40, gap=3)[15:, 10].any()
    assert stepped(40, gap=4)[16:].all()


def test_beyond_a_step_nothing_comes_back():
    z = np.full((24, 1), 700, np.float32)
    z[12:15] = 750
    face = np.ones(z.shape, bool)
    trim_below_drop(face, z, (0, 0), 5, 30.0, 4)
    assert face[:12].all()
    assert not face[12:].any()


@pytest.mark.parametrize("mirrored", [False, True])
def test_what_comes_nearer_again_beside_a_face_is_dropped_on_straight_rays_alone(mirrored):
    row, column = np.mgrid[:21, :41]
    aside = column - 10
    z = np.interp(aside, [0, 8, 14, 30], [700, 740, 760, 700]).astype(np.float32)
    face = np.ones(z.shape, bool)
    start = 40 - 10 if mirrored else 10
    z, face = (np.ascontiguousarray(one[:, ::-1]) if mirrored else one for one in (z, face))
    trim_beside_rise(face, z, (10, start), 8, 12.0)
    cut = ~(face[:, ::-1] if mirrored else face)
    np.testing.assert_array_equal(cut, (aside > 17) & (np.abs(row - 10) <= aside))


def test_nearer_than_that_a_face_may_rise_again_and_elsewhere_it_may_a_little():
    z = np.full((1, 30), 700, np.float32)
    z[0, 3:6] = 740                                    # beside a nose
    z[0, 20:] = 690
    face = np.ones(z.shape, bool)
    trim_beside_rise(face, z, (0, 0), 8, 12.0)
    assert face.all()
