"""Frames of a sensor that has no colour camera."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.frame import DepthMeaning, DepthRounding
from denseface.recon import NoFaceError, reconstruct
from denseface.recon.registration import shaded_depth, with_shaded_depth
from tests.simulator import Person, Scene, measure, simulate
from tests.simulator.heads import head_names
from tests.unit.frames import camera


@pytest.fixture(scope="module")
def depth_alone(shot):
    return replace(shot.frame, color=None)


def test_a_face_is_found_by_its_relief(shot, face, depth_alone):
    found = reconstruct(depth_alone)
    assert not found.report.colored
    assert not found.report.registered
    assert not found.report.settings.shading
    assert any("no colour camera" in warning for warning in found.report.warnings)
    assert 0.9 < found.report.initial_points / face.report.initial_points < 1.1
    with_color, without = (measure(one, shot.truth, shot.frame) for one in (face, found))
    assert without.mean_mm < 1.15 * with_color.mean_mm


def test_colours_are_the_shades_of_the_relief(depth_alone):
    colors = reconstruct(depth_alone).dense.colors
    assert (colors == colors[:, :1]).all()
    assert colors.std() > 10


@pytest.mark.parametrize("person", [
    Person("ict_neutral", 600, yaw=45), Person("mh_cauc_m", 1000, pitch=8)])
def test_turned_near_and_far(person):
    if person.head not in head_names():
        pytest.skip(f"the head {person.head} is not at hand: ../shared/faces")
    shot = simulate(Scene((person,)), seed=3)[0]
    face = reconstruct(replace(shot.frame, color=None))
    assert measure(face, shot.truth, shot.frame).mean_mm < 1.0


def in_the_dark(frame, noise: float):
    noise = np.random.default_rng(3).normal(0, noise, frame.rgb.shape)
    return replace(frame, color=np.clip(np.rint(0.01 * frame.rgb + noise), 0, 255).astype(np.uint8))


def test_where_colour_is_too_dark_the_face_is_found_by_depth_and_grey(shot, depth_alone):
    found, alone = reconstruct(in_the_dark(shot.frame, 4.0)), reconstruct(depth_alone)
    assert not found.report.colored
    assert any("too dark to show a face" in warning for warning in found.report.warnings)
    np.testing.assert_array_equal(found.dense.points, alone.dense.points)
    np.testing.assert_array_equal(found.dense.colors, alone.dense.colors)


def test_nobody_is_found_in_the_dark_where_nobody_is(shot):
    wall = np.full_like(shot.frame.depth, 900)
    with pytest.raises(NoFaceError):
        reconstruct(in_the_dark(replace(shot.frame, depth=wall), 4.0))


@pytest.mark.parametrize("brightness", [60, 150])
def test_depth_does_not_overrule_a_bright_picture_that_shows_no_face(shot, brightness):
    flat = np.full_like(shot.frame.rgb, brightness)
    with pytest.raises(NoFaceError, match="in the colour image"):
        reconstruct(replace(shot.frame, color=flat))


def test_nor_a_dark_one_that_shows_something(shot):
    stripes = np.zeros_like(shot.frame.rgb)
    stripes[:, ::64] = stripes[:, 1::64] = stripes[:, 2::64] = 200
    with pytest.raises(NoFaceError, match="in the colour image"):
        reconstruct(replace(shot.frame, color=stripes))


def test_nobody_is_found_in_an_empty_room():
    shot = simulate(Scene(()), seed=4)[0]
    with pytest.raises(NoFaceError):
        reconstruct(replace(shot.frame, color=None))


def test_tenths_of_a_millimetre_are_the_same_face(shot, depth_alone):
    fine = replace(depth_alone, depth=np.where(depth_alone.depth < 6500, depth_alone.depth * 10, 0)
                   .astype(np.uint16), depth_meaning=DepthMeaning(100, DepthRounding.NONE))
    whole = replace(depth_alone, depth_meaning=DepthMeaning(1000, DepthRounding.NONE))
    one, other = reconstruct(fine), reconstruct(whole)
    assert one.report.depth_unit_um == 100
    np.testing.assert_allclose(one.dense.points.mean(axis=0), other.dense.points.mean(axis=0),
                               atol=0.01)


def test_a_plane_has_one_shade_and_a_hole_is_black():
    plane = np.full((48, 64), 700, np.uint16)
    plane[:, 40:] = 0
    shade = shaded_depth(plane, camera(64, 48, 60.0), 1.0)
    assert np.ptp(shade[4:-4, 4:30]) <= 1
    assert (shade[:, 60:] == 0).all()
    assert shade[24, 10] > 100


def test_a_frame_with_colour_stays_as_it_is(shot):
    assert with_shaded_depth(shot.frame) is shot.frame
