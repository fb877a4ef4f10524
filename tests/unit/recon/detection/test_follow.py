"""Faces looked for by one pass at a time, and followed where they were."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.recon.detection import close_face, detect_face, follow_face, look_for_faces
from denseface.recon.face import FaceCandidate
from denseface.recon.registration import register
from tests.simulator import Person, Scene, simulate

SPARSE = slice(None, None, 4)
FARTHEST_MM = 1300.0


def seen(frame):
    """What detection is given of a frame."""
    return (frame.rgb, register(frame, SPARSE, SPARSE, colors=False), frame.calibration.color.fx)


@pytest.fixture(scope="module")
def pair():
    """Two people, the nearer one on the left."""
    people = (Person(distance_mm=1150, offset_mm=(230, -30)),
              Person(distance_mm=750, offset_mm=(-110, 10)))
    return simulate(Scene(people), seed=1)[0].frame


@pytest.fixture(scope="module")
def nearest(pair):
    return detect_face(*seen(pair)).candidates[0]


def centers_apart(a, b):
    (ax, ay, aw, ah), (bx, by, bw, bh) = a.box, b.box
    return np.hypot(ax + aw / 2 - bx - bw / 2, ay + ah / 2 - by - bh / 2) / bw


def test_a_look_finds_each_of_two_people_once_the_nearer_first(pair, nearest):
    looked = look_for_faces(*seen(pair), 0, FARTHEST_MM)
    assert looked.frontal
    assert looked.searched
    near, far = looked.faces
    assert centers_apart(near, nearest) < 0.25
    assert near.depth_mm < 800
    assert far.depth_mm > 1100


def test_who_is_too_far_is_not_looked_for(pair):
    face, = look_for_faces(*seen(pair), 0, 1000.0).faces
    assert face.depth_mm < 800


def test_turned_faces_have_their_turn(pair):
    kinds = [look_for_faces(*seen(pair), turn, FARTHEST_MM).frontal for turn in range(16)]
    assert kinds[:8] == kinds[8:]
    assert kinds.count(False) == 4


def test_nothing_is_searched_where_all_is_far(pair):
    assert not look_for_faces(*seen(pair), 0, 400.0).searched


def test_a_face_is_followed_where_it_moved(pair, nearest):
    x, y, w, h = nearest.box
    for shift in (0, w // 4, -w // 3):
        last = nearest.model_copy(update={"box": (x + shift, y, w, h)})
        found = follow_face(*seen(pair), last, 0)
        assert found is not None
        assert found.frontal
        assert centers_apart(found.face, nearest) < 0.2


def test_a_face_that_is_gone_is_not_followed(pair, nearest):
    gone = replace(pair, color=np.full_like(pair.rgb, 90))
    assert follow_face(*seen(gone), nearest, 0) is None
    unmeasured = FaceCandidate(box=nearest.box, depth_mm=None, width_mm=None, verdict="no depth")
    assert follow_face(*seen(pair), unmeasured, 0) is None


@pytest.mark.parametrize("box", [(-60, -60, 100, 100), (600, 440, 120, 120), (0, 0, 640, 640)])
def test_a_face_that_was_at_the_border_is_followed_without_an_error(pair, nearest, box):
    follow_face(*seen(pair), nearest.model_copy(update={"box": box}), 1)


def test_only_a_face_that_fills_much_of_the_image_is_close(pair):
    assert not close_face(pair.rgb)
    near = simulate(Scene((Person(distance_mm=330),)), seed=1)[0].frame
    assert close_face(near.rgb)
