import numpy as np
import pytest

from bench.objects import KINDS, make_thing, seen_by
from denseface.capture.calibration import CameraModel

CAMERA = CameraModel(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)
STILL = np.eye(3), np.zeros(3)
MIDDLE = np.array([20.0, -10.0, 800.0])


def painted(color):
    return [np.full((40, 40, 3), color, np.uint8)]


def thing(kind, seed=1):
    return make_thing(kind, np.random.default_rng(seed), painted(200), painted(90), MIDDLE)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_seen_where_it_stands(kind):
    made = thing(kind)
    seen = seen_by(CAMERA, made, STILL)
    there = seen.depth > 0
    assert there.sum() > 30
    rays = np.dstack([CAMERA.rays().reshape(120, 160, 2), np.ones((120, 160))])
    away = rays * seen.depth[..., None]
    assert np.linalg.norm(away[there] - MIDDLE, axis=1).max() < made.radius_mm + 2
    brightest = 90 if kind.startswith("printed") else 200
    assert 0.3 * brightest < seen.color[there].max() <= brightest
    assert np.median(seen.facing[there]) > 0.3


def test_a_ball_is_as_deep_as_it_is_round():
    made = thing("ball")
    seen = seen_by(CAMERA, made, STILL)
    nearest = seen.depth[seen.depth > 0].min()
    assert 800 - made.radius_mm < nearest < 800 - 0.7 * made.radius_mm / 1.3


def test_the_same_seed_makes_the_same_thing():
    assert np.array_equal(seen_by(CAMERA, thing("lumps", 4), STILL).depth,
                          seen_by(CAMERA, thing("lumps", 4), STILL).depth)
