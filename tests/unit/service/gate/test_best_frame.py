"""Which frame is the best, and what a press that takes the best of some seconds gets."""

import pytest

from denseface.recon.quality import Quality, Sight
from denseface.service.gate.faults import Fault
from denseface.service.gate.hinting import Hinting
from denseface.service.gate.pressing import Decision, GatedPress
from denseface.service.gate.scoring import _SEVERITY, score_of, surely_good
from tests.unit.service.gate.test_judging import NOBODY, seen

FACELESS = Quality(1, somebody=True)
TOO_NEAR = Quality(1, somebody=True, too_near=True)
BEST_FIRST = [
    seen(turn_deg=0.0, tilt_deg=0.0, motion_mm=0.2, sharpness=1.0),
    seen(),
    seen(motion_mm=None),
    seen(motion_mm=3.0),
    seen(motion_mm=3.0, turn_deg=18.0),
    seen(off_center=(0.2, 0.0)),
    seen(faces=2, dark=0.6),
    seen(coverage=0.6, motion_mm=3.0),
    seen(motion_mm=5.0),
    seen(motion_mm=15.0),
    seen(turn_deg=30.0, motion_mm=5.0),
    seen(distance_mm=450.0, sight=Sight.DEPTH, motion_mm=9.0, coverage=0.3, faces=2),
    FACELESS,
]


def test_fewer_and_lesser_faults_come_first_then_stillness_sharpness_pose_and_place():
    scores = [score_of(quality) for quality in BEST_FIRST]
    assert scores == sorted(scores)
    assert len(set(scores)) == len(scores)
    assert [score.with_face for score in scores] == [True] * (len(scores) - 1) + [False]


@pytest.mark.parametrize("quality", [NOBODY, TOO_NEAR])
def test_what_can_have_no_face_has_no_score(quality):
    assert score_of(quality) is None
    assert not surely_good(quality)


def test_every_fault_of_a_face_has_its_severity():
    assert {Fault.NOBODY, *_SEVERITY} == {*Fault}


@pytest.mark.parametrize("changes", [
    {"motion_mm": None}, {"motion_mm": 1.1}, {"sharpness": 0.7}, {"turn_deg": 14.0},
    {"tilt_deg": -14.0}, {"off_center": (0.0, -0.11)}, {"faces": 2}, {"turn_deg": None,
                                                                      "coverage": 0.5}])
def test_what_could_be_better_is_not_surely_good(changes):
    assert surely_good(seen(**({"faces": 1} | {"motion_mm": 0.4})))
    assert not surely_good(seen(**changes))


def test_a_sensor_without_colour_can_be_surely_good():
    assert surely_good(seen(sharpness=None, dark=None, burnt=None))


class Press:
    """A press for the best frame of a second, told of a frame at a time."""

    def __init__(self, settled_by_s=0.0):
        self.gated = GatedPress("best", settled_by_s, 1.0)
        self.hinting = Hinting()

    def __call__(self, quality, now_s):
        return self.gated.decide(self.hinting.judge(quality, now_s), now_s)


def test_a_frame_that_is_surely_good_is_taken_at_once():
    press = Press(settled_by_s=0.5)
    assert press(seen(motion_mm=2.0), 0.1) is Decision.KEEP
    assert press(seen(), 0.2) is Decision.TAKE


def test_the_best_frame_of_the_time_is_taken_with_its_faults():
    press = Press()
    assert press(seen(motion_mm=9.0), 0.1) is Decision.KEEP
    assert press(seen(motion_mm=5.0), 0.2) is Decision.KEEP
    assert press(seen(motion_mm=8.0), 0.3) is Decision.WAIT
    assert press(NOBODY, 0.4) is Decision.WAIT
    assert press(seen(motion_mm=7.0), 1.0) is Decision.TAKE_KEPT


def test_after_a_frame_with_nothing_wrong_a_better_one_is_looked_for_a_moment_only():
    press = Press()
    assert press(seen(motion_mm=9.0), 0.1) is Decision.KEEP
    assert press(seen(motion_mm=3.5), 0.2) is Decision.KEEP
    assert press(seen(motion_mm=2.0), 0.4) is Decision.KEEP
    assert press(seen(motion_mm=2.5), 0.49) is Decision.WAIT
    assert press(seen(motion_mm=9.0), 0.52) is Decision.TAKE_KEPT


def test_the_last_frame_may_be_the_best():
    press = Press()
    assert press(seen(motion_mm=9.0), 0.1) is Decision.KEEP
    assert press(seen(motion_mm=5.0), 1.1) is Decision.TAKE


def test_the_only_frame_is_the_best():
    assert Press()(seen(turn_deg=30.0), 2.0) is Decision.TAKE


@pytest.mark.parametrize("quality", [NOBODY, TOO_NEAR])
def test_where_nothing_can_be_had_the_press_is_refused_at_the_end(quality):
    press = Press()
    assert press(quality, 0.1) is Decision.WAIT
    assert press(quality, 1.0) is Decision.REFUSE


def test_somebody_without_a_face_is_taken_where_no_other_frame_came():
    press = Press()
    assert press(FACELESS, 0.1) is Decision.KEEP
    assert press(FACELESS, 0.2) is Decision.WAIT
    assert press(NOBODY, 1.0) is Decision.TAKE_KEPT


def test_a_gate_that_just_began_to_look_does_not_say_that_nobody_is_there():
    press = Press(settled_by_s=1.5)
    assert press(NOBODY, 1.2) is Decision.WAIT
    assert press(FACELESS, 1.3) is Decision.KEEP
    assert press(seen(motion_mm=9.0), 1.4) is Decision.TAKE
