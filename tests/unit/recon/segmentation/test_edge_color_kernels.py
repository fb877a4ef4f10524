"""The background's part of a colour, taken off it."""

import numpy as np
import pytest

from denseface.recon.segmentation._edge_color_kernels import (
    ColorSums,
    MixtureLimits,
    box_sums,
    remove_background,
    summed_area_table,
)

SKIN, WALL = np.array((200, 150, 120)), np.array((30, 220, 40))
LIMITS = MixtureLimits(alike=10.0, part=0.35, distant_part=0.5, aside=0.5, aside_least=10.0,
                       contrast=60.0)
OTHER = np.array((90, 60, 60))


def cleared(color, inner=False, face=SKIN, behind=WALL, distant=WALL, counts=(4, 7, 0)):
    """One pixel of the edge: its colour afterwards, and whether it is the face's own."""
    colors = np.array([[color]], np.uint8)
    own, edge = np.array([[inner]]), np.array([[True]])
    sums = (np.array([[*(count * mean), count]], np.int32)
            for mean, count in zip((face, behind, distant), counts, strict=True))
    remove_background(colors, own, edge, ColorSums(*sums), LIMITS)
    return colors[0, 0].tolist(), bool(own[0, 0])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_a_little_of_the_wall_is_taken_off(share):
    color, own = cleared(np.rint((1 - share) * SKIN + share * WALL))
    assert own
    np.testing.assert_allclose(color, SKIN, atol=1)


def test_a_colour_that_is_much_of_the_wall_is_not_the_faces():
    mixed = (0.5 * SKIN + 0.5 * WALL).astype(np.uint8)
    assert cleared(mixed) == (mixed.tolist(), False)
    assert cleared(mixed, inner=True) == (mixed.tolist(), False)


def test_within_the_rim_a_wall_of_much_the_same_colour_does_not_count():
    wall = SKIN + np.array((20, 10, 0))
    assert cleared(wall, inner=True, behind=wall) == (wall.tolist(), True)
    assert cleared(wall, behind=wall)[1] is False


def test_another_colour_than_a_mixture_stays():
    assert cleared((230, 100, 120)) == ([230, 100, 120], True)


@pytest.mark.parametrize("counts", [(0, 7, 0), (4, 0, 0), (0, 7, 90)])
def test_where_one_of_the_two_is_unknown_nothing_is_said(counts):
    assert cleared((120, 180, 80), counts=counts) == ([120, 180, 80], False)
    assert cleared((120, 180, 80), inner=True, counts=counts) == ([120, 180, 80], True)


@pytest.mark.parametrize("inner", [False, True])
def test_what_shows_a_wall_known_farther_aside_alone_is_not_the_faces(inner):
    """Behind it, nearby, a cut ear; or nothing that is known."""
    mixed = (0.4 * SKIN + 0.6 * WALL).astype(np.uint8)
    assert cleared(mixed, inner, behind=OTHER, counts=(4, 7, 0))[1]
    assert cleared(mixed, inner, behind=OTHER, counts=(4, 7, 1)) == (mixed.tolist(), False)
    assert cleared(mixed, True, counts=(4, 0, 1)) == (mixed.tolist(), False)


def test_of_a_wall_known_farther_aside_alone_nothing_is_taken_off():
    mixed = np.rint(0.6 * SKIN + 0.4 * WALL).astype(np.uint8)
    assert cleared(mixed, True, counts=(4, 0, 90)) == (mixed.tolist(), True)
    assert cleared(mixed, True, behind=SKIN, counts=(4, 7, 90)) == (mixed.tolist(), True)


def test_farther_aside_a_wall_of_much_the_same_colour_does_not_count():
    wall = SKIN + np.array((20, 10, 0))
    assert cleared(wall, True, distant=wall, counts=(4, 0, 90)) == (wall.tolist(), True)


def test_box_sums_are_sums_over_boxes():
    rng = np.random.default_rng(0)
    colors = rng.integers(0, 256, (9, 11, 3), np.uint8)
    mask, wanted = rng.random((2, 9, 11)) < 0.5
    found = box_sums(summed_area_table(colors, mask), wanted, 2)
    for (row, column), sums in zip(np.argwhere(wanted), found, strict=True):
        box = slice(max(row - 2, 0), row + 3), slice(max(column - 2, 0), column + 3)
        np.testing.assert_array_equal(sums[:3], colors[box][mask[box]].sum(axis=0))
        assert sums[3] == mask[box].sum()
