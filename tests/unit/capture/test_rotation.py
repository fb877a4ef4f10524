from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.capture.calibration import Calibration
from denseface.capture.rotation import rotate_frame
from tests.unit.frames import calibration, cameras, frame, poses

TURNS = {90: ((0, -1, 0), (1, 0, 0), (0, 0, 1)), 180: ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
         270: ((0, 1, 0), (-1, 0, 0), (0, 0, 1))}


def some_frame(calibration):
    depth, color = calibration.depth, calibration.color
    made = np.random.default_rng(0)
    return frame(made.integers(0, 5000, (depth.height, depth.width), np.uint16),
                 made.integers(0, 256, (color.height, color.width, 3), np.uint8), calibration)


@given(cameras(), cameras(), poses(), st.sampled_from(sorted(TURNS)))
def test_each_pixel_shows_the_same_point_but_for_the_turn(depth, color, pose, degrees):
    upright = Calibration(depth=depth, color=color, depth_to_color=pose)
    marked = np.zeros((depth.height, depth.width), np.uint16)
    marked[5, 9] = 900
    image = np.zeros((color.height, color.width, 3), np.uint8)
    turned = rotate_frame(frame(marked, image, upright), degrees)
    turn = np.array(TURNS[degrees], float)

    point = depth.back_project(np.array([9, 5]), 900)
    (row,), (column,) = np.nonzero(turned.depth)
    moved = turned.calibration.depth.back_project(np.array([column, row]), 900)
    assert moved == pytest.approx(turn @ point, abs=1e-5)

    seen = color.project(pose.apply(point))
    u, v = seen
    where = {90: (color.height - 1 - v, u), 180: (color.width - 1 - u, color.height - 1 - v),
             270: (v, color.width - 1 - u)}[degrees]
    found = turned.calibration.color.project(turned.depth_to_color.apply(moved))
    assert found == pytest.approx(np.array(where), abs=1e-4)


def test_four_quarters_are_none():
    start = some_frame(calibration())
    turned = start
    for _ in range(4):
        turned = rotate_frame(turned, 90)
    assert turned.calibration == start.calibration
    assert np.array_equal(turned.depth, start.depth)
    assert np.array_equal(turned.color, start.color)
    half = rotate_frame(rotate_frame(start, 90), 90)
    assert half.calibration == rotate_frame(start, 180).calibration


def test_without_color_depth_alone_is_turned():
    lone = replace(some_frame(calibration()), color=None)
    assert rotate_frame(lone, 90).color is None


def test_another_angle_is_refused():
    with pytest.raises(ValueError, match="rotation must be one of"):
        rotate_frame(some_frame(calibration()), 45)
