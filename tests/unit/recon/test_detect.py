"""Stage 2: a face is a box whose size fits its depth, and the nearest one is wanted."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.frame import DepthToColor
from recon.detect import FACE_WIDTH_MM, detect_face, find_boxes
from recon.errors import FaceWithoutDepthError, NoDepthError, NoFaceError
from recon.registration import register
from tests.simulator import Person, Scene, simulate
from tests.unit.frames import calibration


@pytest.fixture(scope="module")
def pair():
    """Two people, the nearer one on the left."""
    return simulate(Scene((Person(distance_mm=1150, offset_mm=(230, -30)),
                           Person(distance_mm=750, offset_mm=(-110, 10)))), seed=1)[0]


def detected(frame):
    return detect_face(frame.color, register(frame), frame.calibration.color.fx)


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


def test_the_nearest_of_two_wins_and_the_other_is_named(pair):
    found = detected(pair.frame)
    near, far = found.candidates
    assert (near.verdict, far.verdict) == ("chosen", "farther")
    assert near.box == found.box
    assert near.depth_mm == found.depth_mm
    assert near.depth_mm < 830 < 1100 < far.depth_mm
    assert near.box[0] < far.box[0]


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


def test_a_poster_beside_a_face_is_named_and_not_chosen(pair):
    depth = pair.frame.depth.copy()
    depth[:, 340:] = 2900  # where the farther head is
    found = detected(replace(pair.frame, depth=depth))
    assert found.depth_mm < 830
    assert [c.verdict for c in found.candidates] == ["chosen", "not a face's size at its depth"]


def test_a_face_without_depth_is_named(shot):
    found = detected(shot.frame)
    depth = shot.frame.depth.copy()
    depth[150:330, 220:420] = 0
    with pytest.raises(FaceWithoutDepthError, match=r"face seen at \(\d+, .*no depth"):
        detected(replace(shot.frame, depth=depth))
    assert found.box[0] > 220


def test_no_face_is_named(shot):
    frame = replace(shot.frame, color=np.full_like(shot.frame.color, 90))
    with pytest.raises(NoFaceError, match="no face found in the colour image"):
        detected(frame)


def test_depth_behind_the_colour_camera_is_named(shot):
    turned = DepthToColor(rotation=((-1, 0, 0), (0, 1, 0), (0, 0, -1)))
    known = shot.frame.calibration
    frame = shot.frame.with_calibration(
        calibration(depth=known.depth, color=known.color, depth_to_color=turned), "turned")
    with pytest.raises(NoDepthError, match="before the colour camera"):
        detected(frame)


def test_a_dark_picture_is_evened_out(shot):
    dark = np.rint(shot.frame.color * 0.12).astype(np.uint8)
    x, y, w, _ = detected(replace(shot.frame, color=dark)).box
    bright = detected(shot.frame).box
    assert np.hypot(x - bright[0], y - bright[1]) < 0.2 * w


def test_boxes_keep_to_their_bounds(shot):
    gray = cv2.cvtColor(shot.frame.color, cv2.COLOR_RGB2GRAY)
    for smallest, largest in ((90, 140), (20, 400)):
        boxes = find_boxes(gray, "haarcascade_frontalface_alt2", smallest, largest)
        assert boxes
        assert all(smallest <= w <= largest and w == h for _, _, w, h in boxes)
    assert find_boxes(gray, "haarcascade_frontalface_alt2", 200, 300) == []


def test_a_cascade_that_is_not_shipped_is_named(shot):
    with pytest.raises(RuntimeError, match="nothing_at_all"):
        find_boxes(shot.frame.color[..., 0], "nothing_at_all", 40, 80)
