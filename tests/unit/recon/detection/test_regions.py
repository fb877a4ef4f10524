"""Where a face can be, by depth."""

import numpy as np
import pytest

from denseface.recon.detection._regions import (
    CELLS,
    nearest_by_cell,
    regions_by_depth,
    without_flat,
)
from denseface.recon.registration import register
from tests.unit.frames import calibration, camera, frame

SIZE = 480, 640
FOCAL_PX = 520.0


def registration(depth, every=1):
    one = camera(640, 480, FOCAL_PX)
    shown = frame(depth.astype(np.uint16), np.zeros((*SIZE, 3), np.uint8),
                  calibration(depth=one, color=one), registered=True)
    part = slice(None, None, every)
    return register(shown, part, part)


def regions(depth, every=1):
    return regions_by_depth(registration(depth, every), SIZE, FOCAL_PX)


def bulging(depth, every=4):
    one = registration(depth, every)
    return without_flat(
        regions_by_depth(one, SIZE, FOCAL_PX), nearest_by_cell(one, SIZE), SIZE, FOCAL_PX)


def with_ball(depth, column, row, distance, radius_mm=80):
    """A ball before what is there."""
    v, u = np.mgrid[:480, :640]
    away = np.hypot(u - column, v - row) * distance / FOCAL_PX
    inside = away < radius_mm
    depth[inside] = distance + radius_mm - np.sqrt(radius_mm**2 - away[inside] ** 2)


@pytest.fixture
def two():
    """A near thing on the left, a farther one on the right, before a wall out of reach."""
    depth = np.full(SIZE, 2600.0)
    depth[200:320, 100:220] = 700
    depth[150:260, 400:500] = 1300
    return depth


def covers(region, left, top, right, bottom):
    x, y, w, h = region.roi
    return x <= left and y <= top and x + w >= right and y + h >= bottom


@pytest.mark.parametrize("every", [1, 4])
def test_the_nearest_comes_first_and_the_wall_not_at_all(two, every):
    near, far = regions(two, every)
    assert near.near_mm <= 700 < near.far_mm <= far.near_mm <= 1300 < far.far_mm
    assert covers(near, 100, 200, 220, 320)
    assert covers(far, 400, 150, 500, 260)


def test_a_region_holds_a_face_whose_sides_are_in_the_next_layer(two):
    near, far = regions(two)
    around = 80 * FOCAL_PX / 1300
    assert covers(far, 400 - around, 150 - around, 500 + around, 260 + around)
    x, y, w, h = near.roi
    assert (x, y) >= (0, 0)
    assert w * h < 0.3 * 640 * 480


def test_what_is_smaller_than_a_face_is_left_out(two):
    two[200:320, 100:220] = 2600
    two[200:240, 100:140] = 700
    assert [r.near_mm > 1000 for r in regions(two)] == [True]


def test_small_gaps_do_not_cut_a_thing_in_two(two):
    two[200:320, 155:160] = 0
    assert len(regions(two)) == 2


def test_each_region_lies_inside_the_image(two):
    two[:, :60] = 400
    two[430:, :] = 900
    for region in regions(two):
        x, y, w, h = region.roi
        assert x >= 0
        assert y >= 0
        assert x + w <= 640
        assert y + h <= 480


@pytest.mark.parametrize("every", [1, 4])
def test_a_center_of_a_face_is_where_a_thing_is(two, every):
    near, far = regions(two, every)
    side = 640 / CELLS
    for region, (left, top, right, bottom), millimetres in (
            (near, (100, 200, 220, 320), 700), (far, (400, 150, 500, 260), 1300)):
        rows, columns = np.nonzero(region.centers)
        inside = region.centers[round(top / side):round(bottom / side),
                                round(left / side):round(right / side)]
        assert inside.mean() > 0.95
        out = 50 * FOCAL_PX / millimetres / side
        assert columns.min() >= left / side - out
        assert columns.max() <= right / side + out
        assert rows.min() >= top / side - out
        assert rows.max() <= bottom / side + out


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("slant", [0.0, 0.6])
def test_a_wall_is_left_out_and_a_ball_before_it_is_not(every, slant):
    depth = 1100 + slant * (np.arange(640) - 320) + np.zeros(SIZE)
    assert bulging(depth, every) == []
    with_ball(depth, 200, 240, 700)
    region, = (r for r in bulging(depth, every) if r.near_mm <= 700 < r.far_mm)
    side = 640 / CELLS
    assert region.centers[round(240 / side), round(200 / side)]
    # Whole boxes, of the widest face, fit about all that is left.
    rows, columns = np.nonzero(region.centers)
    half = 105 * FOCAL_PX / region.near_mm
    assert covers(region, (columns.min() + 0.5) * side - half, (rows.min() + 0.5) * side - half,
                  (columns.max() + 0.5) * side + half, (rows.max() + 0.5) * side + half)


def test_a_ball_where_little_is_measured_is_not_left_out():
    """Too few depths do not tell."""
    depth = np.zeros(SIZE)
    with_ball(depth, 320, 240, 1500)
    depth[:, np.arange(640) % 32 > 1] = 0
    everything = regions(depth, 1)
    assert len(bulging(depth, 1)) == len(everything)


def test_nothing_is_left_of_nothing():
    assert without_flat(
        [], nearest_by_cell(registration(np.full(SIZE, 900.0)), SIZE), SIZE, FOCAL_PX) == []
