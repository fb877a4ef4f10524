"""Where more than the first pass is worth it."""

import numpy as np
import pytest

from denseface.recon.detection import _detect, detect_face
from denseface.recon.detection._head_regions import LIKELY, MAYBE, likeness
from denseface.recon.detection._passes import STRAIGHT
from denseface.recon.errors import NoFaceError
from denseface.recon.finding import find_face
from denseface.recon.judgement import score_quickly
from denseface.recon.registration import register
from tests.unit.frames import calibration, camera, frame

SIZE, FOCAL_PX, CELL_PX = (480, 640), 520.0, 8.0
EVERY = slice(None, None, 4)


def seen(depth):
    one = camera(640, 480, FOCAL_PX)
    shown = frame(depth.astype(np.uint16), np.zeros((*SIZE, 3), np.uint8),
                  calibration(depth=one, color=one), registered=True)
    return register(shown, EVERY, EVERY)


def with_ball(depth, column, distance, radius_mm=90):
    v, u = np.mgrid[:480, :640]
    away = np.hypot(u - column, v - 240) * distance / FOCAL_PX
    inside = away < radius_mm
    depth[inside] = distance + radius_mm - np.sqrt(radius_mm**2 - away[inside] ** 2)


def centers(*columns):
    found = np.zeros((60, 80), bool)
    for column in columns:
        found[27:33, round(column / CELL_PX) - 3:round(column / CELL_PX) + 3] = True
    return found


def test_a_face_is_likely_and_a_ball_is_not(shot):
    found = find_face(shot.frame, lambda _: None)
    x, y, w, h = found.detection.box
    cell = shot.frame.rgb.shape[1] / 80
    middle = np.zeros((60, 80), bool)
    middle[round((y + h / 2) / cell), round((x + w / 2) / cell)] = True
    depth = found.detection.depth_mm
    assert likeness(found.overview, middle, (depth - 30, depth), cell,
                    shot.frame.calibration.color.fx, score_quickly) >= LIKELY
    room = np.full(SIZE, 2600.0)
    with_ball(room, 320, 800)
    assert likeness(seen(room), centers(320), (800, 820), CELL_PX, FOCAL_PX, score_quickly) < MAYBE


def test_each_of_two_heads_that_hang_together_is_looked_at():
    room = np.full(SIZE, 2600.0)
    with_ball(room, 220, 800)
    with_ball(room, 420, 800)
    places = []

    def score(points):
        places.append(np.median(points[:, 0]))
        return 0.0

    likeness(seen(room), centers(220, 420), (800, 820), CELL_PX, FOCAL_PX, score)
    assert len(places) == 3
    assert np.ptp(places) == pytest.approx(200 * 830 / FOCAL_PX, rel=0.25)


def test_points_are_those_of_its_depth_and_few():
    room = np.full(SIZE, 900.0)
    with_ball(room, 320, 600)
    given = []
    likeness(seen(room), centers(320), (600, 620), CELL_PX, FOCAL_PX,
             lambda points: given.append(points) or 0.0)
    points, = given
    assert 80 < len(points) <= 800
    assert points[:, 2].max() < 740
    assert np.hypot(*points[:, :2].T).max() < 130


def test_where_no_head_is_likely_the_first_pass_alone_looks(shot, monkeypatch):
    ran = []
    monkeypatch.setattr(_detect.Search, "_seen_in",
                        lambda _self, one, _region, _gray: ran.append(one) or [])
    registered = register(shot.frame, EVERY, EVERY, colors=False)
    focal_px = shot.frame.calibration.color.fx
    with pytest.raises(NoFaceError):
        detect_face(shot.frame.rgb, registered, focal_px, score=lambda _: 0.0)
    assert set(ran) == {STRAIGHT}
    ran.clear()
    with pytest.raises(NoFaceError):
        detect_face(shot.frame.rgb, registered, focal_px, score=lambda _: 1.0)
    assert len(set(ran)) > 5
