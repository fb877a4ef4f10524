"""Where depth looks like a head."""

import numpy as np
import pytest

from denseface.recon.detection._head_regions import depth_cells, head_regions, largest
from denseface.recon.detection._regions import CELLS
from denseface.recon.registration import register
from tests.unit.frames import calibration, camera, frame

SIZE = 480, 640
FOCAL_PX = 520.0
CELL_PX = SIZE[1] / CELLS


def regions(depth, every=4, **limit):
    one = camera(640, 480, FOCAL_PX)
    shown = frame(depth.astype(np.uint16), np.zeros((*SIZE, 3), np.uint8),
                  calibration(depth=one, color=one), registered=True)
    part = slice(None, None, every)
    return head_regions(depth_cells(register(shown, part, part), SIZE, FOCAL_PX), **limit)


def with_head(depth, column, row, distance, half_mm=75):
    """Half an ellipsoid before what is there, as wide as a head, higher than wide."""
    v, u = np.mgrid[:480, :640]
    away = np.hypot(u - column, (v - row) / 1.35) * distance / FOCAL_PX
    inside = (away < half_mm) & (depth > distance)
    depth[inside] = distance + half_mm - np.sqrt(half_mm**2 - away[inside] ** 2)


@pytest.fixture
def wall():
    return np.full(SIZE, 2600.0)


@pytest.fixture
def two(wall):
    """A near head on the left, a farther one on the right."""
    with_head(wall, 160, 260, 700)
    with_head(wall, 450, 205, 1300)
    return wall


def covers(region, left, top, right, bottom):
    x, y, w, h = region.roi
    return x <= left and y <= top and x + w >= right and y + h >= bottom


@pytest.mark.parametrize("every", [1, 4])
def test_the_nearest_comes_first_with_the_middle_of_its_face(two, every):
    near, far = regions(two, every)
    for region, column, row, distance in ((near, 160, 260, 700), (far, 450, 205, 1300)):
        assert distance - 5 < region.near_mm < distance + 15 < region.far_mm < distance + 150
        assert region.centers[round(row / CELL_PX), round(column / CELL_PX)]
        rows, columns = np.nonzero(region.centers)
        reach = 130 * FOCAL_PX / distance / CELL_PX
        assert np.hypot(rows - row / CELL_PX, columns - column / CELL_PX).max() < reach


def test_the_widest_face_about_each_middle_is_searched_whole(two):
    for region in regions(two):
        rows, columns = np.nonzero(region.centers)
        half = 105 * FOCAL_PX / region.near_mm
        assert covers(region, max((columns.min() + 0.5) * CELL_PX - half, 0),
                      max((rows.min() + 0.5) * CELL_PX - half, 0),
                      (columns.max() + 0.5) * CELL_PX + half, (rows.max() + 0.5) * CELL_PX + half)
        x, y, w, h = region.roi
        assert x >= 0
        assert y >= 0
        assert x + w <= 640
        assert y + h <= 480


def test_what_is_farther_than_asked_is_left_out(two):
    near, = regions(two, nearer_than_mm=1290)
    assert near.near_mm < 720
    assert regions(two, nearer_than_mm=690) == []


@pytest.mark.parametrize("slant", [0.0, 0.6])
def test_a_wall_has_none_however_slanted_and_a_head_before_it_is_found(slant):
    depth = 1100 + slant * (np.arange(640) - 320) + np.zeros(SIZE)
    assert regions(depth) == []
    with_head(depth, 320, 240, 700)
    region, = regions(depth)
    assert region.near_mm == pytest.approx(700, abs=10)


@pytest.mark.parametrize("past", [0, 2600])
def test_the_edge_of_a_cupboard_is_none(wall, past):
    """With a wall far past it, or nothing."""
    wall[:] = past
    wall[:, :330] = 900
    assert regions(wall) == []


@pytest.mark.parametrize(("half_mm", "found"), [(75, 1), (55, 1), (30, 0)])
def test_a_child_is_found_and_a_cup_is_not(wall, half_mm, found):
    with_head(wall, 320, 240, 900, half_mm)
    assert len(regions(wall)) == found


def test_a_head_whose_half_is_outside_the_image_is_left_out(wall):
    with_head(wall, 5, 240, 700)
    assert regions(wall) == []


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_readings_that_are_missing_here_and_there_do_not_hide_a_head(wall, share):
    with_head(wall, 320, 240, 900)
    wall[np.random.default_rng(0).random(SIZE) < share] = 0
    assert len(regions(wall)) == 1


def test_a_head_beside_another_is_found(wall):
    with_head(wall, 250, 240, 800)
    with_head(wall, 390, 240, 830)
    assert [round(r.near_mm, -1) for r in regions(wall)] == [800, 830]


def test_the_largest_places_are_kept_in_their_order_whatever_their_distance(two):
    near, far = regions(two)
    less = near._replace(centers=near.centers & (np.arange(CELLS) % 2 == 0))
    assert largest([less, near], 1) == [near]
    assert largest([near, far], 2) == [near, far]
