"""The quality of a frame, against scenes of which it is known."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from denseface.capture.calibration import DepthToColor
from denseface.capture.frame import DepthMeaning
from denseface.recon.quality import Sight, measure
from tests.simulator import Person, Scene, simulate
from tests.unit.frames import calibration, camera, frame, resampled
from tests.unit.recon.quality.conftest import framed, stream

TURNS = pytest.mark.parametrize("degrees", [-20, 15])


@pytest.fixture(scope="module")
def empty():
    """A room without anybody."""
    return simulate(Scene(()), seed=2)[0].frame


@pytest.fixture(scope="module")
def pair():
    """Two people, the nearer one on the left."""
    people = (Person(distance_mm=1150, offset_mm=(230, -30)),
              Person(distance_mm=750, offset_mm=(-110, 10)))
    return simulate(Scene(people), seed=1)[0].frame


def test_nobody_is_there(empty):
    found = stream(empty, empty)
    assert not found.somebody
    assert not found.too_near
    assert found.faces == 0
    assert found.face is None


def test_no_cascade_runs_when_nobody_is_there(empty, monkeypatch):
    monkeypatch.setattr("denseface.recon.detection._detect.run_pass", pytest.fail)
    assert not stream(empty, empty).somebody


def test_a_face_ahead_is_measured(ahead):
    found = stream(ahead, ahead)
    assert found.somebody
    assert found.faces == 1
    face = found.face
    assert face.sight is Sight.AHEAD
    assert face.distance_mm == pytest.approx(755, abs=15)
    assert face.off_center == pytest.approx((-0.02, 0), abs=0.05)
    assert abs(face.turn_deg) < 7
    assert abs(face.tilt_deg) < 7
    assert face.coverage > 0.9
    assert face.motion_mm < 0.3
    assert face.sharpness > 0.9
    assert face.dark < 0.02
    assert face.burnt == 0


@pytest.mark.parametrize("mm", [520, 1200])
def test_the_distance_is_that_of_the_face(mm):
    frame = framed(distance_mm=float(mm))
    assert stream(*[frame] * 6).face.distance_mm == pytest.approx(mm, abs=20)


@TURNS
def test_a_face_that_is_turned_by_so_many_degrees(degrees):
    frame = framed(head="procedural", yaw=float(degrees))
    face = stream(*[frame] * 6).face
    assert face.turn_deg == pytest.approx(degrees, abs=7)


@TURNS
def test_a_face_that_is_tilted_by_so_many_degrees(degrees):
    frame = framed(head="procedural", pitch=float(degrees))
    face = stream(*[frame] * 6).face
    assert face.tilt_deg == pytest.approx(degrees, abs=7)


def test_who_stands_aside_is_off_center_and_turned_away_unless_they_look_at_the_camera():
    mm = 150.0
    away = math.degrees(math.atan(mm / 750))
    aside = stream(*[framed(offset_mm=(mm, 0.0))] * 6).face
    assert aside.off_center[0] == pytest.approx(mm * 525 / 750 / 640, abs=0.05)
    assert aside.turn_deg == pytest.approx(away, abs=7)
    looking = stream(*[framed(offset_mm=(mm, 0.0), yaw=-away)] * 6).face
    assert abs(looking.turn_deg) < 7


def test_who_looks_far_aside_does_not_pass_for_one_who_looks_ahead():
    face = stream(*[framed(yaw=50.0)] * 8).face
    assert face is None or face.sight is not Sight.AHEAD or abs(face.turn_deg) > 20


def test_the_nearer_of_two_is_measured_and_the_other_said(pair):
    found = stream(*[pair] * 10)
    assert found.faces == 2
    assert found.face.distance_mm == pytest.approx(755, abs=20)
    assert found.face.off_center[0] < 0


def test_without_color_a_face_is_found_by_its_depth(ahead):
    frame = replace(ahead, color=None)
    found = stream(frame, frame)
    assert found.faces == 1
    face = found.face
    assert face.distance_mm == pytest.approx(755, abs=20)
    assert face.off_center == pytest.approx((-0.02, 0), abs=0.08)
    assert abs(face.turn_deg) < 12
    assert face.motion_mm < 0.3
    assert (face.sharpness, face.dark, face.burnt) == (None, None, None)


def test_depth_in_tenths_of_a_millimetre_is_the_same_depth(ahead):
    tenths = replace(ahead, depth=ahead.depth * np.uint16(10),
                     depth_meaning=DepthMeaning(unit_um=100))
    assert stream(*[tenths] * 2).face.distance_mm == pytest.approx(
        stream(*[ahead] * 2).face.distance_mm, abs=1)


@pytest.mark.parametrize("factor", [0.5, 2])
def test_another_resolution_gives_the_same_measures(ahead, factor):
    face = stream(*[ahead] * 4).face
    other = stream(*[resampled(ahead, factor)] * 4).face
    assert other.distance_mm == pytest.approx(face.distance_mm, abs=10)
    assert other.off_center == pytest.approx(face.off_center, abs=0.03)
    assert other.coverage == pytest.approx(face.coverage, abs=0.1)
    assert other.turn_deg == pytest.approx(face.turn_deg, abs=8)


def test_a_face_that_moves_is_seen_to_move_by_so_much(ahead):
    moved = framed(offset_mm=(9.0, 0.0))
    assert stream(ahead, ahead, moved).face.motion_mm == pytest.approx(3, abs=0.7)
    nearer = framed(distance_mm=735.0)
    assert stream(ahead, ahead, nearer).face.motion_mm == pytest.approx(5, abs=1)
    colorless = [replace(frame, color=None) for frame in (ahead, ahead, moved)]
    assert stream(*colorless).face.motion_mm == pytest.approx(3, abs=1)


def test_without_a_frame_just_before_nothing_is_known_of_motion(ahead):
    assert stream(ahead).face.motion_mm is None
    first = measure(ahead)
    for later in (0, -1, 2_000_000):
        stamp = ahead.depth_timestamp_us + later
        assert measure(replace(ahead, depth_timestamp_us=stamp), first).face.motion_mm is None


def test_a_blurred_face_is_less_sharp_than_before(ahead):
    blurred = replace(ahead, color=np.asarray(cv2.GaussianBlur(ahead.color, (0, 0), 3), np.uint8))
    assert stream(ahead, ahead, blurred).face.sharpness < 0.6
    assert stream(blurred, ahead).face.sharpness == 1


def test_nobody_is_less_sharp_than_somebody_who_was_there_a_while_ago(ahead):
    """The next visitor was told to hold still until the last one's beard was forgotten."""
    smooth = replace(ahead, color=np.asarray(cv2.GaussianBlur(ahead.color, (0, 0), 3), np.uint8))
    first = measure(ahead, at_us=1_000_000)
    assert measure(smooth, first, at_us=2_900_000).face.sharpness < 0.6
    assert measure(smooth, first, at_us=3_100_000).face.sharpness == 1


def test_dark_and_burnt_parts_are_measured(ahead):
    half = ahead.color.copy()
    half[:, :half.shape[1] // 2] //= 12
    assert 0.3 < stream(*[replace(ahead, color=half)] * 8).face.dark < 0.8
    bright = np.clip(ahead.color.astype(np.uint16) * 3, 0, 255).astype(np.uint8)
    assert stream(*[replace(ahead, color=bright)] * 8).face.burnt > 0.5


def test_what_of_the_face_has_no_depth_is_not_covered(ahead):
    w = stream(ahead, ahead).face.box[2]
    holes = ahead.depth.copy()
    holes[:, (640 // 2 - w // 6):(640 // 2 + w // 6)] = 0
    assert stream(*[replace(ahead, depth=holes)] * 2).face.coverage < 0.75


def test_a_face_that_has_no_depth_because_it_is_so_near_is_too_near():
    close = framed(distance_mm=330.0)
    blind = replace(close, depth=np.where(close.depth < 450, 0, close.depth).astype(np.uint16))
    found = measure(blind)
    assert found.too_near
    assert found.somebody


def test_furniture_without_a_face_is_nobody_after_a_while(ahead):
    wardrobe = replace(ahead, color=np.full_like(ahead.color, 90))
    begun = stream(*[wardrobe] * 3)
    assert begun.somebody
    assert begun.face.sight is Sight.DEPTH
    assert not stream(*[wardrobe] * 40).somebody
    depth = np.where(ahead.depth > 0, ahead.depth + 40, 0).astype(np.uint16)
    came = replace(ahead, depth=depth)
    assert stream(*[wardrobe] * 40, *[came] * 4).face.sight is Sight.AHEAD


def test_a_wall_or_a_photograph_is_nobody(ahead):
    wall = replace(ahead, depth=np.full_like(ahead.depth, 800))
    found = stream(*[wall] * 40)
    assert found.face is None
    assert not found.somebody


@pytest.mark.parametrize("depth", [0, 399, 65535])
def test_depth_that_says_nothing(ahead, depth):
    assert stream(*[replace(ahead, depth=np.full_like(ahead.depth, depth))] * 2).face is None


@pytest.mark.parametrize("translation", [(0.0, 0.0, -5000.0), (4000.0, 0.0, 0.0)])
def test_a_calibration_by_which_the_camera_sees_nothing(ahead, translation):
    pose = DepthToColor(translation_mm=translation)
    calib = ahead.calibration.model_copy(update={"depth_to_color": pose})
    assert stream(*[replace(ahead, calibration=calib)] * 2).face is None


@pytest.mark.parametrize("size", [(1, 1), (300, 1), (1, 300), (3, 200), (9000, 2)])
def test_images_of_every_size(ahead, size):
    depth = np.ascontiguousarray(cv2.resize(ahead.depth, size).reshape(size[::-1]), np.uint16)
    color = np.asarray(cv2.resize(ahead.rgb, size).reshape(*size[::-1], 3), np.uint8)
    known = camera(*size, f=float(max(size)))
    one = frame(depth, color, calibration(depth=known, color=known))
    assert stream(one, one).face is None
    assert stream(*[replace(one, color=None)] * 2).face is None


def test_the_same_frames_give_the_same_measures(ahead):
    one, other = (stream(*[ahead] * 3).face for _ in range(2))
    assert one == other
