"""Which frames of a live sensor are judged, and which of them a press gets."""

from dataclasses import replace

import pytest

from denseface.capture.live.sensor import Shot
from denseface.recon.quality import FaceQuality, Quality, Sight
from denseface.service.gate import frame_judge
from denseface.service.gate.live import Hinted, LiveGate, NotPassed, Passed
from denseface.service.protocol import messages
from tests.unit.service.faces import small_frame

GOOD = FaceQuality(
    box=(250, 170, 120, 120), sight=Sight.AHEAD, distance_mm=750.0, off_center=(0.0, 0.0),
    coverage=0.95, turn_deg=3.0, tilt_deg=-4.0, motion_mm=0.4, sharpness=0.95, dark=0.0, burnt=0.0)
PERIOD_S = 1 / 30


class Sensor:
    """Gives a frame each thirtieth of a second, up to the present time."""

    def __init__(self):
        self.now = 100.0
        frame = small_frame()
        self.shots = [Shot(replace(frame, depth_timestamp_us=index), index,
                           100 + index * PERIOD_S, 100 + index * PERIOD_S + 0.01)
                      for index in range(1000)]

    def first_after(self, after_s, *, closely):
        assert not closely
        known = [shot for shot in self.shots if shot.latest_s <= self.now][-4:]
        return next((shot for shot in known if shot.earliest_s >= after_s), None)


class Gate:
    """A gate whose frames are good from a number on; nobody is there before."""

    def __init__(self, monkeypatch, good_from=10_000):
        self.sensor = Sensor()
        self.measured = []
        self.good_from = good_from
        self.motion_mm = {}
        """By the frame's number, where it is not still."""
        monkeypatch.setattr(frame_judge, "measure", self.measure)
        self.spent_s = self.costs_s = self.takes_s = 0.0
        self.gate = LiveGate(self.sensor, lambda: None, clock=lambda: self.sensor.now,
                             cost_clock=lambda: self.spent_s)

    def measure(self, frame, previous, at_us):
        number = frame.depth_timestamp_us
        self.measured.append(number)
        self.spent_s += self.costs_s
        self.sensor.now += self.takes_s
        assert at_us == round(self.sensor.shots[number].earliest_s * 1e6)
        if number < self.good_from:
            return Quality(number, somebody=False)
        face = replace(GOOD, motion_mm=self.motion_mm.get(
            number, None if previous is None else 0.4))
        return Quality(number, somebody=True, faces=1, face=face)

    def run(self, seconds):
        """Let time pass, a tenth of a period at a time, and give what came of it."""
        found = []
        end = self.sensor.now + seconds
        while self.sensor.now < end:
            self.sensor.now += PERIOD_S / 10
            found += self.gate.step()
            if self.gate._call is not None:
                self.gate._call.result()
        return found


@pytest.fixture
def gate(monkeypatch):
    made = Gate(monkeypatch)
    yield made
    made.gate.close()


def take(gate="wait", timeout=2.0):
    return messages.Take(capture_id="a", gate=gate, gate_timeout=timeout)


def test_nothing_is_judged_while_nobody_asks(gate):
    assert gate.run(1.0) == []
    assert gate.measured == []


def test_hints_come_ten_times_a_second_while_they_are_asked_for(gate):
    gate.gate.send_hints(2.0)
    hints = gate.run(3.0)
    assert 18 <= len(hints) <= 21
    assert all(isinstance(one, Hinted) for one in hints)
    assert {one.hint.codes for one in hints} == {("nobody",)}
    assert len(gate.measured) <= 21


def test_what_is_costly_to_judge_is_judged_less_often(gate):
    gate.gate.send_hints(10.0)
    gate.costs_s = 0.06
    gate.run(6.0)
    assert 0.15 <= gate.spent_s / 6 <= 0.21


def test_the_cost_of_the_first_frame_does_not_silence_the_hints(gate):
    """It is that of loading kernels: 3 s of it were 15 s without a hint."""
    gate.gate.send_hints(10.0)
    gate.costs_s = 3.0
    gate.run(0.1)
    gate.costs_s = 0.005
    assert len(gate.run(3.0)) >= 20


def test_who_waits_does_not_wait_for_that(gate):
    gate.costs_s = 0.06
    gate.gate.press(take(timeout=1.0))
    gate.run(0.9)
    assert len(gate.measured) >= 25


def test_while_previews_are_looked_at_frames_are_judged_and_no_hints_sent(gate):
    gate.gate.look(1.0)
    assert gate.run(1.0) == []
    assert len(gate.measured) >= 9
    shot, hint = gate.gate.last_hint()
    assert hint.timestamp_us == shot.number == gate.sensor.shots[gate.measured[-1]].number
    assert gate.gate.judging is None


def test_a_hint_stays_while_the_next_frame_is_judged(gate):
    """On a slow machine one frame follows the other: there would be no hint at any time."""
    gate.takes_s = 0.3
    gate.gate.look(2.0)
    gate.run(1.0)
    assert gate.gate.judging.number == gate.measured[-1]
    assert gate.gate.last_hint()[0].number == gate.measured[-2]


def test_who_waits_gets_the_first_good_frame_and_no_other(gate):
    gate.run(1.0)
    gate.good_from = 45
    gate.gate.press(take())
    passed, = gate.run(2.5)
    assert isinstance(passed, Passed)
    # Of the first good one it is not known whether the person moves.
    assert passed.shot.number == gate.good_from
    assert passed.shot.number == gate.measured[-1]
    assert gate.run(1.0) == []


def test_every_frame_is_judged_while_somebody_waits(gate):
    gate.gate.press(take(timeout=1.0))
    gate.run(0.9)
    assert gate.measured == [*range(gate.measured[0], gate.measured[-1] + 1)]
    assert len(gate.measured) >= 25


def test_who_waits_in_vain_is_refused_with_the_last_hint(gate):
    gate.gate.press(take(timeout=1.0))
    assert gate.run(0.95) == []
    refused, = gate.run(0.2)
    assert isinstance(refused, NotPassed)
    assert refused.judged.refusal == "step in front of the camera"
    assert refused.judged.hint.timestamp_us == gate.measured[-1]


def test_refuse_refuses_at_once_where_the_gate_was_looking(gate):
    gate.gate.send_hints(10.0)
    gate.run(1.0)
    gate.gate.press(take("refuse"))
    found = [one for one in gate.run(0.1) if not isinstance(one, Hinted)]
    assert [type(one) for one in found] == [NotPassed]


def test_refuse_looks_for_half_a_second_where_it_was_not(gate):
    gate.gate.press(take("refuse"))
    assert gate.run(0.45) == []
    refused, = gate.run(0.2)
    assert isinstance(refused, NotPassed)


@pytest.mark.parametrize("kind", ["wait", "refuse"])
def test_the_first_frame_is_not_taken_before_motion_is_known(monkeypatch, kind):
    made = Gate(monkeypatch, good_from=0)
    made.gate.press(take(kind))
    passed, = made.run(0.5)
    assert passed.shot.number == made.measured[1]
    made.gate.close()


def test_a_frame_from_before_the_press_is_not_the_presss(monkeypatch):
    made = Gate(monkeypatch, good_from=0)
    made.gate.send_hints(10.0)
    made.run(1.0)
    pressed = made.sensor.now
    made.gate.press(take())
    passed, = (one for one in made.run(0.3) if isinstance(one, Passed))
    assert passed.shot.earliest_s >= pressed
    made.gate.close()


def best_of(made, seconds, motion_mm):
    """Press for the best frame after a second of hints; the motion of each frame from then on."""
    made.gate.send_hints(10.0)
    made.run(1.0)
    first = next(shot.number for shot in made.sensor.shots
                 if shot.earliest_s >= made.sensor.now)
    made.motion_mm = {first - 1: 0.0} | {
        first + index: moved for index, moved in enumerate(motion_mm)}
    made.gate.press(take("best", seconds))
    passed, = (one for one in made.run(2.0) if isinstance(one, Passed))
    made.gate.close()
    return passed.shot.number - first


def test_the_best_frame_of_the_time_is_taken_and_none_from_before_the_press(monkeypatch):
    made = Gate(monkeypatch, good_from=0)
    assert best_of(made, 0.3, [9.0, 7.0, 5.0, 3.0, 4.0, *[8.0] * 20]) == 3


def test_a_frame_that_is_surely_good_ends_the_time(monkeypatch):
    made = Gate(monkeypatch, good_from=0)
    assert best_of(made, 1.0, [9.0, 3.0, 0.5, 0.1, *[8.0] * 30]) == 2


def test_the_best_frame_of_nobody_is_none(gate):
    gate.gate.press(take("best", 0.3))
    assert gate.run(0.45) == []
    refused, = gate.run(0.2)
    assert isinstance(refused, NotPassed)
    assert refused.judged.refusal == "step in front of the camera"


def test_a_press_that_is_withdrawn_gets_nothing(gate):
    gate.gate.press(take())
    gate.gate.withdraw("a")
    gate.good_from = 0
    assert gate.run(1.0) == []


def test_what_cannot_be_measured_is_not_good(gate, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("at the camera's plane")

    monkeypatch.setattr(frame_judge, "measure", fail)
    gate.gate.send_hints(1.0)
    assert {one.hint.codes for one in gate.run(1.0)} == {("look_here",)}


def test_lack_of_memory_is_not_taken_for_a_bad_frame(gate, monkeypatch):
    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(frame_judge, "measure", fail)
    gate.gate.send_hints(1.0)
    with pytest.raises(MemoryError):
        gate.run(1.0)
