import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.capture.calibration import Calibration, DepthToColor
from denseface.capture.frame import DepthMeaning, DepthRounding
from denseface.recon.errors import NoDepthError
from denseface.recon.registration import register, sample_colors
from tests.unit.frames import calibration, camera, cameras, frame, poses

NEAR, FAR = 600, 1200


def two_planes() -> tuple[np.ndarray, np.ndarray]:
    """A near square before a far wall, as seen by the depth camera and by the colour camera."""
    depth = np.full((120, 160), FAR, np.uint16)
    depth[40:80, 60:100] = NEAR
    u, v = np.meshgrid(np.arange(160), np.arange(120))
    calib = calibration()
    color = np.zeros((120, 160, 3), np.uint8)
    color[..., 2] = 200  # the wall is blue
    # In the colour image, the square is red and stands where its corners project.
    corners = calib.depth.back_project(np.array([[59.5, 39.5], [99.5, 79.5]]), NEAR)
    (left, top), (right, bottom) = calib.color.project(calib.depth_to_color.apply(corners))
    color[(u > left) & (u < right) & (v > top) & (v < bottom)] = (200, 0, 0)
    return depth, color


def test_colours_belong_to_their_points():
    depth, color = two_planes()
    registered = register(frame(depth, color))
    inside = np.zeros(depth.shape, bool)
    inside[42:78, 63:97] = True
    assert registered.visible[inside].all()
    assert (registered.colors[inside] == (200, 0, 0)).all()
    wall = registered.visible & (depth == FAR)
    wall[36:84, 50:110] = False
    assert (registered.colors[wall] == (0, 0, 200)).all()


def test_a_hidden_point_takes_no_colour():
    depth, color = two_planes()
    registered = register(frame(depth, color))
    # The colour camera, to the left of the depth camera, cannot see the wall right of the square
    # for 25 mm * f * (1/near - 1/far) = 3 pixels.
    hidden = ~registered.visible & (depth == FAR)
    assert hidden[41:79, 100:103].all()
    assert (registered.colors[hidden] == 0).all()
    # Elsewhere only the square's outline, one pixel wide, and what the colour image ends before.
    hidden[38:82, 58:106] = hidden[:, -5:] = False
    assert not hidden.any()
    # No wall point took the square's red.
    assert not ((registered.colors[..., 0] > 150) & (depth == FAR)).any()


@settings(deadline=None, max_examples=25)
@given(depth_camera=cameras(), color_camera=cameras(), pose=poses(), seed=st.integers(0, 99))
def test_projection_is_that_of_the_calibration(depth_camera, color_camera, pose, seed):
    # Any cameras; small images, to be quick.
    small = depth_camera.scaled(48 / depth_camera.width)
    color_camera = color_camera.scaled(64 / color_camera.width)
    depth = np.random.default_rng(seed).integers(0, 3000, (small.height, small.width), np.uint16)
    depth[0, 0] = 900
    color = np.zeros((color_camera.height, color_camera.width, 3), np.uint8)
    calib = Calibration(depth=small, color=color_camera, depth_to_color=pose)
    registered = register(frame(depth, color, calib))
    np.testing.assert_array_equal(registered.valid, depth > 0)
    row, column = np.argwhere(registered.valid)[seed % 7]
    point = small.back_project(np.array([column, row]), depth[row, column])
    np.testing.assert_allclose(registered.points[row, column], point, rtol=1e-6)
    moved = pose.apply(point)
    np.testing.assert_allclose(registered.color_depth[row, column], max(moved[2], 0), rtol=1e-6)
    if moved[2] > 0:
        np.testing.assert_allclose(
            registered.pixels[row, column], color_camera.project(moved), rtol=1e-4, atol=1e-2)
    assert np.isnan(registered.pixels[~registered.valid]).all()
    assert not registered.visible[~registered.valid].any()


def test_colour_camera_of_twice_the_resolution():
    depth, _ = two_planes()
    calib = calibration(color=camera(320, 240, f=300.0))
    color = np.tile(np.arange(320) // 2, (240, 1)).astype(np.uint8)
    registered = register(frame(depth, np.dstack([color] * 3), calib))
    shown = registered.visible
    np.testing.assert_allclose(
        registered.colors[shown, 0], np.floor(registered.pixels[shown, 0]) / 2, atol=1.1)
    # A closed near surface lets nothing behind it shine through.
    assert (registered.visible[42:78, 64:96]).all()


def test_registered_depth_needs_no_moving():
    depth, _ = two_planes()
    color = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
    registered = register(frame(depth, color, registered=True))
    np.testing.assert_array_equal(registered.colors[registered.visible],
                                  color[registered.visible])
    around = ~registered.visible
    assert not around[41:79, 61:99].any()
    around[38:82, 58:102] = False
    assert not around.any()


@pytest.mark.parametrize(("meaning", "z"), [
    (DepthMeaning(), 700.0),
    (DepthMeaning(rounding=DepthRounding.CUT), 700.5),
    (DepthMeaning(rounding=DepthRounding.NONE), 700.0),
    (DepthMeaning(100), 70.0),
    (DepthMeaning(100, DepthRounding.CUT), 70.05),
    (DepthMeaning(2000, DepthRounding.CUT), 1401.0),
])
def test_a_depth_means_what_its_frame_says(meaning, z):
    depth = np.full((120, 160), 700, np.uint16)
    shot = frame(depth, np.zeros((120, 160, 3), np.uint8), depth_meaning=meaning)
    np.testing.assert_allclose(register(shot).points[..., 2], z, rtol=1e-6)


def test_a_number_beyond_the_farthest_reading_is_none():
    depth = np.full((120, 160), 700, np.uint16)
    depth[:, :80] = 4095
    shot = frame(depth, np.zeros((120, 160, 3), np.uint8), depth_meaning=DepthMeaning(max_mm=4000))
    registered = register(shot)
    assert not registered.valid[:, :80].any()
    assert registered.valid[:, 80:].all()


def test_depth_behind_the_colour_camera_is_not_visible():
    turned = DepthToColor(rotation=((-1, 0, 0), (0, 1, 0), (0, 0, -1)))
    depth, color = two_planes()
    registered = register(frame(depth, color, calibration(depth_to_color=turned)))
    assert not registered.visible.any()


def test_empty_depth_is_named():
    with pytest.raises(NoDepthError, match="empty"):
        register(frame(np.zeros((120, 160), np.uint16), np.zeros((120, 160, 3), np.uint8)))


def test_points_are_sampled_as_if_they_had_been_measured():
    depth, color = two_planes()
    shot = frame(depth, color)
    registered = register(shot)
    colors, seen = sample_colors(shot, registered, registered.points.reshape(-1, 3))
    np.testing.assert_array_equal(seen, registered.visible.ravel())
    np.testing.assert_array_equal(colors[seen], registered.colors[registered.visible])
    assert colors.dtype == np.uint8


def test_what_lies_outside_or_behind_is_not_seen():
    depth, color = two_planes()
    shot = frame(depth, color)
    behind = shot.depth_camera.back_project(np.array([[80.0, 60.0]]), 900.0)
    aside, backward = np.array([[5000.0, 0.0, 700.0]]), np.array([[0.0, 0.0, -700.0]])
    points = np.concatenate([behind, aside, backward]).astype(np.float32)
    _, seen = sample_colors(shot, register(shot), points)
    assert not seen.any()
