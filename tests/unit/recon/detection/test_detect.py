"""Stage 2: a face is a box whose size fits its depth, and the nearest one is wanted."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from denseface.capture.calibration import DepthToColor
from denseface.recon.detection import FACE_WIDTH_MM, _detect, detect_face
from denseface.recon.detection._cascades import Seen
from denseface.recon.detection._passes import PROFILES
from denseface.recon.errors import FaceWithoutDepthError, NoDepthError, NoFaceError
from denseface.recon.registration import register
from tests.simulator import Light, Person, Scene, simulate
from tests.unit.frames import calibration


@pytest.fixture(scope="module")
def pair():
    """Two people, the nearer one on the left."""
    return simulate(Scene((Person(distance_mm=1150, offset_mm=(230, -30)),
                           Person(distance_mm=750, offset_mm=(-110, 10)))), seed=1)[0]


def detected(frame):
    return detect_face(frame.rgb, register(frame), frame.calibration.color.fx)


def seen_at(frame, millimetres):
    """The same picture on a flat thing so far away, something else both near and far."""
    depth = np.full_like(frame.depth, millimetres)
    depth[:, :40] = 450
    depth[:, -40:] = 2500
    return replace(frame, depth=depth)


def test_the_face_is_found_where_the_head_is(shot):
    found = detected(shot.frame)
    x, y, w, h = found.box
    middle = shot.truth.face_points().mean(axis=0)
    calib = shot.frame.calibration
    u, v = calib.color.project(calib.depth_to_color.apply(middle))
    assert abs(x + w / 2 - u) < 0.15 * w
    assert abs(y + h / 2 - v) < 0.2 * h
    assert 680 < found.depth_mm < 760
    (chosen,) = found.candidates
    assert (chosen.verdict, chosen.box) == ("chosen", found.box)
    assert FACE_WIDTH_MM[0] <= chosen.width_mm <= FACE_WIDTH_MM[1]
    assert chosen.width_mm == pytest.approx(w * chosen.depth_mm / calib.color.fx)


def test_the_nearest_of_two_wins_and_nothing_behind_it_is_searched(pair):
    found = detected(pair.frame)
    near, = found.candidates
    assert near.verdict == "chosen"
    assert near.box == found.box
    assert near.depth_mm == found.depth_mm
    assert near.depth_mm < 830


def test_the_farther_one_is_found_when_the_nearer_has_no_depth(pair):
    depth = pair.frame.depth.copy()
    depth[(depth > 0) & (depth < 1000)] = 0
    found = detected(replace(pair.frame, depth=depth))
    assert found.depth_mm > 1100
    chosen, *others = found.candidates
    assert chosen.verdict == "chosen"
    assert all((c.verdict, c.depth_mm) == ("no depth", None) for c in others)


@pytest.mark.parametrize(("millimetres", "wide"), [(2000, "4[0-9]{2}"), (420, "(9[0-9]|10[0-9])")])
def test_a_picture_of_a_wrong_size_for_its_depth_is_refused(shot, millimetres, wide):
    """A poster far away; a photograph held near."""
    with pytest.raises(NoFaceError, match=f"is {wide} mm wide at its depth, a face is 110-210 mm"):
        detected(seen_at(shot.frame, millimetres))


def slanted(depth, distance):
    """A plane, at one distance in the middle, farther to the right and below."""
    v, u = np.mgrid[:depth.shape[0], :depth.shape[1]]
    plane = distance + 0.4 * (u - depth.shape[1] / 2) + 0.2 * (v - depth.shape[0] / 2)
    return np.rint(plane).astype(depth.dtype)


def test_a_photograph_of_a_faces_size_is_refused_because_it_is_flat(shot):
    assert detected(shot.frame).depth_mm == pytest.approx(720, abs=40)
    with pytest.raises(NoFaceError, match=r"the box at \(\d+, .* shows is flat"):
        detected(replace(shot.frame, depth=slanted(shot.frame.depth, 720)))


def test_what_was_rejected_afterwards_is_passed_over(pair):
    frame = pair.frame
    registered, focal_px = register(frame), frame.calibration.color.fx
    near = detect_face(frame.rgb, registered, focal_px)
    far = detect_face(frame.rgb, registered, focal_px, (near.box,))
    assert near.depth_mm < 830
    assert far.depth_mm > 1100
    assert "no face by its shape" in {c.verdict for c in far.candidates}
    with pytest.raises(NoFaceError, match=r"the box at \(\d+, .* is no face by its shape"):
        detect_face(frame.rgb, registered, focal_px, (near.box, far.box))


def test_a_photograph_before_a_face_is_not_chosen(pair):
    depth = pair.frame.depth.copy()
    photograph = np.s_[:, :340]  # where the nearer head is
    depth[photograph] = slanted(depth, 850)[photograph]
    found = detected(replace(pair.frame, depth=depth))
    assert found.depth_mm > 1100
    assert {c.verdict for c in found.candidates} <= {"chosen", "flat"}


def center_off(found, shot):
    """How far the box's centre is from the true face's, in widths of the box."""
    calib = shot.frame.calibration
    pixels = calib.color.project(calib.depth_to_color.apply(shot.truth.face_points()))
    x, y, w, h = found.box
    away = (x + w / 2, y + h / 2) - (pixels.min(axis=0) + pixels.max(axis=0)) / 2
    return float(np.hypot(*away)) / w


@pytest.mark.parametrize(("turn", "off"), [
    ({"roll": 25.0}, 0.15), ({"roll": -35.0}, 0.15), ({"yaw": 60.0}, 0.3), ({"yaw": -60.0}, 0.3)])
def test_a_face_tipped_aside_or_in_profile_is_found_about_its_center(turn, off):
    shot, = simulate(Scene((Person(distance_mm=750, **turn),)), seed=3)
    found = detected(shot.frame)
    assert center_off(found, shot) < off
    assert 130 < found.candidates[0].width_mm < 205
    _, _, w, h = found.box
    assert abs(w - h) <= 1


def test_the_center_stays_when_the_images_are_turned(shot):
    """The same head, both images turned about the same place, off the middle of the image."""
    known = shot.frame.calibration
    one = known.color
    frame = replace(shot.frame, calibration=calibration(
        depth=known.depth, color=one, depth_to_color=DepthToColor()))
    straight = detected(frame)
    x, y, w, h = straight.box
    turn = cv2.getRotationMatrix2D((x + w / 2, y + h / 2), -25, 1)
    size = one.width, one.height
    tipped = replace(
        frame, color=cv2.warpAffine(frame.rgb, turn, size),
        depth=cv2.warpAffine(frame.depth, turn, size, flags=cv2.INTER_NEAREST))
    u, v, wide, high = detected(tipped).box
    assert abs(u + wide / 2 - (x + w / 2)) < 0.1 * w
    assert abs(v + high / 2 - (y + h / 2)) < 0.1 * w
    assert wide == pytest.approx(w, rel=0.15)


@pytest.mark.parametrize(("nearer", "farther"), [
    ({"distance_mm": 700, "roll": 33}, {"distance_mm": 1150, "offset_mm": (230, -30)}),
    ({"distance_mm": 750, "yaw": -60}, {"distance_mm": 1150, "offset_mm": (230, -30)}),
    ({"distance_mm": 820, "roll": -33}, {"distance_mm": 860, "offset_mm": (110, -10)}),
    ({"distance_mm": 715, "roll": -18, "skin_gain": (0.03,) * 3},
     {"distance_mm": 730, "offset_mm": (110, -10)}),
    ({"distance_mm": 715, "roll": 18, "skin_gain": (0.02,) * 3},
     {"distance_mm": 1000, "offset_mm": (110, -10)})])
def test_a_nearer_face_wins_though_the_coarse_pass_sees_only_the_farther(nearer, farther):
    one = Person(offset_mm=(-110, 10), **nearer)
    shot, = simulate(Scene((Person(**farther), one)), seed=1)
    alone, = simulate(Scene((one,)), seed=1)
    found = detected(shot.frame)
    assert found.depth_mm < one.distance_mm + 20
    assert [c.verdict for c in found.candidates] == ["chosen", "farther"]
    assert [c.verdict for c in detected(alone.frame).candidates] == ["chosen"]


@pytest.mark.parametrize("distance_mm", [600, 1000])
def test_the_box_is_as_wide_as_a_face_whatever_the_coarse_pass_gave(distance_mm):
    widths = []
    for step in range(3):
        shot, = simulate(Scene((Person(distance_mm=distance_mm + 35 * step),)), seed=step)
        widths.append(detected(shot.frame).candidates[0].width_mm)
    assert max(widths) < 1.12 * min(widths)
    assert min(widths) > 145
    assert max(widths) < 190


@pytest.mark.parametrize("nobody", [
    Scene(()), Scene((), wall_mm=800), Scene((Person(yaw=180),)), Scene((Person(yaw=140),)),
    Scene((Person(offset_mm=(0, -470)),))])
def test_no_face_is_seen_where_there_is_none(nobody):
    shot, = simulate(nobody, seed=2)
    with pytest.raises(NoFaceError):
        detected(shot.frame)


def test_a_face_without_depth_is_named(shot):
    found = detected(shot.frame)
    depth = shot.frame.depth.copy()
    depth[150:330, 220:420] = 0
    with pytest.raises(FaceWithoutDepthError, match=r"face seen at \(\d+, .*no depth"):
        detected(replace(shot.frame, depth=depth))
    assert found.box[0] > 220


def test_no_face_is_named(shot):
    frame = replace(shot.frame, color=np.full_like(shot.frame.rgb, 90))
    with pytest.raises(NoFaceError, match="no face found in the colour image"):
        detected(frame)


def test_depth_behind_the_colour_camera_is_named(shot):
    turned = DepthToColor(rotation=((-1, 0, 0), (0, 1, 0), (0, 0, -1)))
    known = shot.frame.calibration
    frame = shot.frame.with_calibration(
        calibration(depth=known.depth, color=known.color, depth_to_color=turned), "turned")
    with pytest.raises(NoDepthError, match="before the colour camera"):
        detected(frame)


def test_a_face_in_a_dark_picture_is_found(shot):
    dark = np.rint(shot.frame.rgb * 0.12).astype(np.uint8)
    x, y, w, _ = detected(replace(shot.frame, color=dark)).box
    bright = detected(shot.frame).box
    assert np.hypot(x - bright[0], y - bright[1]) < 0.2 * w


def test_a_dark_face_is_found_though_tipped():
    shot, = simulate(Scene((Person(roll=18, skin_gain=(0.015,) * 3),)), seed=1)
    assert center_off(detected(shot.frame), shot) < 0.2


def test_a_face_against_the_light_is_found_by_the_contrast_at_its_own_depth():
    against = Light((0.3, -0.5, 1.0), intensity=1.6, ambient=0.02)
    shot, = simulate(Scene((Person(roll=-18),), wall_mm=1500, wall_color=(255, 255, 250),
                           light=against), seed=1)
    assert center_off(detected(shot.frame), shot) < 0.2


def test_a_face_tipped_far_and_lit_from_the_side_is_found_with_the_shadows_lifted(monkeypatch):
    beside = Light((-1.0, -0.1, -0.1), 0.75, 0.08)
    shot, = simulate(Scene((Person(roll=38, distance_mm=700, skin_gain=(0.5,) * 3),),
                           light=beside), seed=3)
    assert center_off(detected(shot.frame), shot) < 0.2
    monkeypatch.setattr(_detect, "LIFTED_RUNGS", ())
    with pytest.raises(NoFaceError):
        detected(shot.frame)


@pytest.mark.parametrize("more", PROFILES)
def test_of_two_profiles_that_run_together_the_one_of_most_windows_wins(shot, monkeypatch, more):
    x, y, w, h = detected(shot.frame).box
    boxes = {one: (x + shift, y, w, h) for one, shift in zip(PROFILES, (-9, 9), strict=True)}
    monkeypatch.setattr(_detect, "run_pass", lambda _gray, _roi, one, *_:
                        [Seen(boxes[one], 8 if one == more else 3)])
    search = _detect.Search(shot.frame.rgb, register(shot.frame), shot.frame.calibration.color.fx)
    assert search.nearest_face(PROFILES, search.regions, search.as_taken).cascade_pass == more
