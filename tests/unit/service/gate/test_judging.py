"""From what is measured to what is said."""

from dataclasses import replace

import pytest

from denseface.recon.quality import FaceQuality, Quality, Sight
from denseface.service.gate.faults import Fault
from denseface.service.gate.hinting import SHOWN_S, Hinting
from denseface.service.gate.judging import faults_of
from denseface.service.gate.pressing import Decision, GatedPress
from denseface.service.gate.thresholds import Thresholds

GOOD = FaceQuality(
    box=(250, 170, 120, 120), sight=Sight.AHEAD, distance_mm=750.0, off_center=(0.0, 0.0),
    coverage=0.95, turn_deg=3.0, tilt_deg=-4.0, motion_mm=0.4, sharpness=0.95, dark=0.0, burnt=0.0)


def seen(faces=1, **changes):
    return Quality(1, somebody=True, faces=faces, face=replace(GOOD, **changes))


NOBODY = Quality(1, somebody=False)
FAULTY = [
    (NOBODY, Fault.NOBODY),
    (Quality(1, somebody=True), Fault.LOOK_HERE),
    (Quality(1, somebody=True, too_near=True), Fault.MOVE_BACK),
    (seen(distance_mm=480.0), Fault.MOVE_BACK),
    (seen(distance_mm=1210.0), Fault.COME_CLOSER),
    (seen(faces=2), Fault.ONE_PERSON),
    (seen(off_center=(0.0, 0.2)), Fault.MOVE_UP),
    (seen(off_center=(0.0, -0.2)), Fault.MOVE_DOWN),
    (seen(sight=Sight.ASIDE), Fault.LOOK_HERE),
    (seen(sight=Sight.DEPTH), Fault.LOOK_HERE),
    (seen(turn_deg=-24.0), Fault.LOOK_HERE),
    (seen(tilt_deg=24.0), Fault.LOOK_HERE),
    (seen(coverage=0.6), Fault.UNCOVER),
    (seen(dark=0.6), Fault.MORE_LIGHT),
    (seen(burnt=0.4), Fault.LESS_LIGHT),
    (seen(motion_mm=5.0), Fault.HOLD_STILL),
    (seen(sharpness=0.4), Fault.HOLD_STILL),
]


@pytest.mark.parametrize(("quality", "fault"), FAULTY)
def test_each_fault_is_found_alone(quality, fault):
    assert faults_of(quality, Thresholds()) == (fault,)


def test_nothing_is_wrong_with_a_good_frame():
    assert faults_of(seen(), Thresholds()) == ()


def test_what_is_not_known_is_not_wrong():
    unknown = seen(turn_deg=None, tilt_deg=None, motion_mm=None, sharpness=None, dark=None,
                   burnt=None)
    assert faults_of(unknown, Thresholds()) == ()


def test_left_is_the_persons_left():
    # In an image that is not mirrored, who looks at the camera has their left at its right: who
    # stands too far to the image's left has to go to their own left.
    assert faults_of(seen(off_center=(-0.3, 0.0)), Thresholds()) == (Fault.MOVE_LEFT,)
    assert faults_of(seen(off_center=(0.3, 0.0)), Thresholds()) == (Fault.MOVE_RIGHT,)


def test_too_near_is_asked_first_and_standing_still_last():
    worst = seen(faces=2, distance_mm=430.0, off_center=(-0.3, 0.3), turn_deg=40.0, coverage=0.2,
                 dark=1.0, motion_mm=9.0)
    assert faults_of(worst, Thresholds()) == (
        Fault.MOVE_BACK, Fault.ONE_PERSON, Fault.MOVE_LEFT, Fault.MOVE_UP, Fault.LOOK_HERE,
        Fault.UNCOVER, Fault.MORE_LIGHT, Fault.HOLD_STILL)


@pytest.mark.parametrize(("change", "fault"), [
    ({"distance_mm": 510.0}, Fault.MOVE_BACK), ({"distance_mm": 1180.0}, Fault.COME_CLOSER),
    ({"off_center": (-0.13, 0.0)}, Fault.MOVE_LEFT), ({"turn_deg": 18.0}, Fault.LOOK_HERE),
    ({"tilt_deg": -18.0}, Fault.LOOK_HERE), ({"coverage": 0.72}, Fault.UNCOVER),
    ({"dark": 0.45}, Fault.MORE_LIGHT), ({"burnt": 0.25}, Fault.LESS_LIGHT),
    ({"motion_mm": 3.5}, Fault.HOLD_STILL), ({"sharpness": 0.55}, Fault.HOLD_STILL)])
def test_what_was_wrong_has_to_become_better_than_what_was_not(change, fault):
    assert faults_of(seen(**change), Thresholds()) == ()
    assert faults_of(seen(**change), Thresholds(), held=(fault,)) == (fault,)


def said(*steps):
    """Judge (seconds, quality) in order, and give the texts."""
    hinting = Hinting()
    return [hinting.judge(quality, now).hint.text for now, quality in steps]


FAR, MOVING = seen(distance_mm=1250.0), seen(motion_mm=9.0)


def test_a_hint_is_said_at_once_where_there_was_none():
    assert said((0.0, seen()), (0.1, FAR)) == ["", "come closer"]


def test_a_hint_stays_long_enough_to_be_read():
    texts = said((0.0, FAR), (0.1, MOVING), (SHOWN_S - 0.01, MOVING), (SHOWN_S, MOVING))
    assert texts == ["come closer"] * 3 + ["hold still"]


def test_the_last_hint_goes_when_it_was_read():
    texts = said((0.0, FAR), (0.3, seen()), (SHOWN_S, seen()), (SHOWN_S + 0.1, MOVING))
    assert texts == ["come closer", "come closer", "", "hold still"]


def test_each_hint_of_a_flicker_is_shown_long_enough():
    steps = [(0.1 * i, (FAR, MOVING, NOBODY, seen())[i % 4]) for i in range(200)]
    texts, begun = said(*steps), 0.0
    for (_, _), (now, _), text, following in zip(steps, steps[1:], texts, texts[1:], strict=False):
        if following != text:
            assert not text or now - begun >= SHOWN_S - 1e-9
            begun = now


def test_the_codes_are_of_the_frame_itself_whatever_is_said():
    hinting = Hinting()
    hinting.judge(FAR, 0.0)
    judged = hinting.judge(seen(), 0.1)
    assert judged.ready
    assert judged.hint.ok
    assert judged.refusal == ""
    again = hinting.judge(MOVING, 0.2)
    assert again.hint.codes == ("hold_still",)
    assert again.refusal == "hold still"


def test_a_hint_holds_what_was_measured():
    hint = Hinting().judge(seen(), 0.0).hint
    assert hint.timestamp_us == 1
    assert hint.measures["distance_mm"] == 750
    assert hint.measures["turn_deg"] == 3
    assert hint.measures["faces"] == 1
    nobody = Hinting().judge(NOBODY, 0.0).hint
    assert nobody.measures == {"faces": 0}
    assert nobody.text == "step in front of the camera"


def test_every_hint_fits_its_message():
    worst = seen(faces=2, distance_mm=430.123, off_center=(-0.3123, 0.3123), turn_deg=-40.123,
                 tilt_deg=-44.123, coverage=0.2123, dark=0.9123, burnt=0.1123, motion_mm=99.123,
                 sharpness=0.1123)
    assert len(Hinting().judge(worst, 0.0).hint.codes) == 8


GATES = pytest.mark.parametrize("gate", ["wait", "refuse"])


def decided(gate, quality, now, settled_by=0.0):
    judged = Hinting().judge(quality, now)
    return GatedPress(gate, settled_by_s=settled_by, deadline_s=10.0).decide(judged, now)


@GATES
def test_a_good_frame_is_taken(gate):
    assert decided(gate, seen(), 1.0) is Decision.TAKE


def test_a_frame_that_is_not_good_enough():
    assert decided("off", FAR, 1.0) is Decision.TAKE
    assert decided("refuse", FAR, 1.0) is Decision.REFUSE
    assert decided("wait", FAR, 1.0) is Decision.WAIT
    assert decided("wait", FAR, 10.0) is Decision.REFUSE


@GATES
def test_the_first_frames_decide_nothing_while_the_gate_knows_no_motion(gate):
    assert decided(gate, seen(motion_mm=None), 0.1, settled_by=0.5) is Decision.WAIT
    assert decided(gate, FAR, 0.1, settled_by=0.5) is Decision.WAIT
    assert decided(gate, seen(), 0.1, settled_by=0.5) is Decision.TAKE
    assert decided(gate, seen(motion_mm=None), 0.5, settled_by=0.5) is Decision.TAKE
    assert decided("refuse", FAR, 0.5, settled_by=0.5) is Decision.REFUSE
