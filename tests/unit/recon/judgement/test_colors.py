"""Colours of another place, as of a mirrored image, are told by where eyes and mouth are."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.recon import NoFaceError, pipeline, reconstruct
from denseface.recon.judgement import LEAST_COLOR_LIKENESS, color_likeness
from tests.simulator import Light, Person, Scene, simulate

STRAIGHT = np.array([*np.eye(3).ravel(), 0, 0, 0, 1.0])
DOUBT = "eyes, brows and mouth are not seen where depth has them"


@pytest.fixture(scope="module", params=[(-1.0, -0.1, -0.25), (1.0, -0.1, -0.25)],
                ids=["light from the left", "light from the right"])
def frame(request):
    person = Person("procedural", 700.0, offset_mm=(45.0, 0.0))
    scene = Scene((person,), light=Light(request.param, 0.75, 0.12), decor=4)
    return simulate(scene, seed=4)[0].frame


def doubts_of(frame):
    return [one for one in reconstruct(frame).report.warnings if DOUBT in one]


def test_a_face_with_its_own_colors_is_not_doubted(frame):
    assert doubts_of(frame) == []


def test_colors_of_another_place_are_told_of(frame):
    elsewhere = np.roll(frame.rgb, round(35 * frame.calibration.color.fx / 700), axis=1)
    assert len(doubts_of(replace(frame, color=elsewhere))) == 1


def painted(dark):
    """A plane of gray before which the mean face stands straight, dark in some places."""
    x, y = (side.ravel() for side in np.meshgrid(np.arange(-65, 66, 2.0), np.arange(-70, 61, 2.0)))
    gray = np.full(len(x), 160)
    for u, v, half in dark:
        gray[(np.abs(np.abs(x) - u) < half) & (np.abs(y - v) < 7)] = 60
    points = np.stack([x, y, np.full(len(x), 5.0)], axis=1).astype(np.float32)
    return points, np.repeat(gray[:, None], 3, axis=1).astype(np.uint8)


def test_dark_eyes_and_mouth_are_alike_and_dark_cheeks_are_not():
    eyes_and_mouth, cheeks = ((31, -32, 12), (0, 37, 20)), ((35, 12, 12),)
    assert color_likeness(STRAIGHT, *painted(eyes_and_mouth)) > 0.3
    assert color_likeness(STRAIGHT, *painted(cheeks)) < LEAST_COLOR_LIKENESS


def test_too_little_of_a_face_says_nothing():
    points, colors = painted(())
    assert color_likeness(STRAIGHT, points[:100], colors[:100]) is None


def test_a_doubtful_shape_with_colors_of_another_place_is_none(frame, monkeypatch):
    judge = pipeline.judge_shape
    monkeypatch.setattr(pipeline, "judge_shape", lambda s: judge(s)._replace(score=0.7))
    assert reconstruct(frame).report.face_score == 0.7
    elsewhere = np.roll(frame.rgb, round(35 * frame.calibration.color.fx / 700), axis=1)
    with pytest.raises(NoFaceError, match="no darker where eyes, brows and mouth would be"):
        reconstruct(replace(frame, color=elsewhere))
