"""Presses with a gate, and hints, of a live sensor and of a recording."""

from collections import deque
from types import SimpleNamespace

import pytest

from denseface.capture.live.states import LiveState
from denseface.recon.quality import Quality
from denseface.service.daemons import _live_supply, _reader_supply
from denseface.service.daemons._live_supply import LiveSupply
from denseface.service.daemons._reader_supply import ReaderSupply
from denseface.service.daemons._supply import Hinted, NotTaken, Picture, Taken
from denseface.service.gate import frame_judge
from denseface.service.gate.faults import Fault
from denseface.service.gate.hinting import Hinting, Judged
from denseface.service.gate.live import NotPassed, Passed
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.messages import Take
from tests.unit.service.daemons.test_capture import Driver, FakeReader
from tests.unit.service.daemons.test_live_supply import FakeSensor
from tests.unit.service.gate.test_judging import seen
from tests.waiting import until

HINT = Hint(timestamp_us=7, codes=("nobody",), text="step in front of the camera")
NOBODY = Judged(Quality(7, somebody=False), (Fault.NOBODY,), HINT)
GOOD = Judged(Quality(7, somebody=True), (), Hint(timestamp_us=7))


class FakeGate:
    """Says what it is told."""

    def __init__(self, *_):
        self.says = deque()
        self.asked = []
        self.withdrawn = []
        self.looked_s = self.hints_s = 0.0
        self.judging = self.hint = None
        self.closed = False

    def press(self, take):
        self.asked.append(take.capture_id)

    def withdraw(self, capture_id):
        self.withdrawn.append(capture_id)

    def look(self, seconds):
        self.looked_s = seconds

    def send_hints(self, seconds):
        self.hints_s = seconds

    def last_hint(self):
        return self.hint

    def step(self):
        while self.says:
            yield self.says.popleft()

    def close(self):
        self.closed = True


@pytest.fixture
def sensor():
    return FakeSensor()


@pytest.fixture
def supply(sensor, monkeypatch):
    monkeypatch.setattr(_live_supply, "LiveGate", FakeGate)
    monkeypatch.setattr(_live_supply, "time", SimpleNamespace(monotonic=lambda: 100.0))
    supply = LiveSupply(sensor, 5.0)
    yield supply
    supply.wake.close()


@pytest.fixture
def gate(supply):
    return supply._gate


def outcomes(supply):
    return list(supply.step(busy=False))


def press(supply, **more):
    supply.press(Take(**{"capture_id": "a", "gate": "wait", "gate_timeout": 3} | more))


def test_a_gated_press_gets_the_frame_that_its_gate_passed_and_no_other(supply, sensor, gate):
    for at_s in (1e9, 1e9 + 1):
        sensor.shoot(at_s)
    press(supply)
    press(supply)
    assert outcomes(supply) == []
    assert gate.asked == ["a"]
    gate.says.append(Passed("a", sensor.shots[1]))
    (taken,) = outcomes(supply)
    assert isinstance(taken, Taken)
    assert taken.frame.depth is sensor.shots[1].frame.depth


def test_a_frame_that_the_sensor_has_no_more_is_taken_as_it_was_judged(supply, sensor, gate):
    for at_s in (1e9, 1e9 + 1):
        sensor.shoot(at_s)
    press(supply)
    judged = sensor.shots.pop(0)
    gate.says.append(Passed("a", judged))
    (taken,) = outcomes(supply)
    assert taken.frame.depth is judged.frame.depth


def test_a_gated_burst_begins_with_that_frame(supply, sensor, gate):
    press(supply, frames=2)
    sensor.shoot(1e9)
    gate.says.append(Passed("a", sensor.shots[0]))
    assert outcomes(supply) == []
    sensor.shoot(1e9 + 1)
    (taken,) = until(lambda: outcomes(supply))
    assert isinstance(taken, Taken)


def test_what_the_gate_does_not_pass_is_refused_with_the_hint(supply, gate):
    press(supply, gate="refuse")
    gate.says.append(NotPassed("a", NOBODY))
    assert outcomes(supply) == [NotTaken("a", "step in front of the camera", HINT)]
    assert outcomes(supply) == []


def test_a_press_without_a_gate_is_none_of_its_business(supply, sensor, gate):
    press(supply, gate="off")
    sensor.shoot(1e9)
    assert len(outcomes(supply)) == 1
    assert gate.asked == []


def test_a_sensor_that_goes_is_the_reason_and_the_gate_forgets_the_press(supply, sensor, gate):
    press(supply)
    sensor.state, sensor.reason = LiveState.ABSENT, "it was unplugged"
    assert outcomes(supply) == [NotTaken("a", "it was unplugged")]
    assert gate.withdrawn == ["a"]


def test_a_gated_press_waits_as_long_as_its_gate_and_the_sensor_together(
    supply, sensor, monkeypatch
):
    clock = [100.0]
    monkeypatch.setattr(_live_supply.time, "monotonic", lambda: clock[0])
    press(supply)
    sensor.state, sensor.reason = LiveState.STALLED, "silent"
    clock[0] += 7.9
    assert outcomes(supply) == []
    clock[0] += 0.2
    assert len(outcomes(supply)) == 1


def test_a_picture_waits_for_its_hint(supply, sensor, gate, monkeypatch):
    clock = [99.04]
    monkeypatch.setattr(_live_supply.time, "monotonic", lambda: clock[0])
    sensor.shoot(99.0)
    supply.preview()
    assert gate.looked_s > 0
    gate.judging = sensor.shots[0]
    assert outcomes(supply) == []
    sensor.shoot(99.03)  # a newer one does not go first: then none would have a hint
    assert outcomes(supply) == []
    gate.judging, gate.hint = None, (sensor.shots[0], HINT)
    assert outcomes(supply) == [Picture(sensor.shots[0].frame, HINT)]
    supply.preview()
    assert outcomes(supply) == [Picture(sensor.shots[1].frame, None)]
    supply.preview()
    assert outcomes(supply) == []


def test_a_picture_does_not_wait_for_ever(supply, sensor, gate, monkeypatch):
    clock = [99.08]
    monkeypatch.setattr(_live_supply.time, "monotonic", lambda: clock[0])
    sensor.shoot(99.0)
    sensor.shoot(99.05)
    supply.preview()
    gate.judging = sensor.shots[0]
    assert outcomes(supply) == []
    clock[0] += 0.1
    assert outcomes(supply) == [Picture(sensor.shots[1].frame, None)]
    gate.judging, gate.hint = None, (sensor.shots[0], HINT)
    supply.preview()
    assert outcomes(supply) == []  # a mirror does not go back
    sensor.shoot(99.2)
    assert outcomes(supply) == [Picture(sensor.shots[2].frame, HINT)]  # and yet says what was found
    sensor.shoot(99.3)
    supply.preview()
    assert outcomes(supply) == [Picture(sensor.shots[3].frame, None)]  # once


def test_a_hint_that_comes_far_too_late_is_none(supply, sensor, gate):
    sensor.shoot(99.0)
    supply.preview()
    assert outcomes(supply) == [Picture(sensor.shots[0].frame, None)]
    gate.hint = sensor.shots[0], HINT
    sensor.shoot(101.1)
    supply.preview()
    assert outcomes(supply) == [Picture(sensor.shots[1].frame, None)]


def test_hints_are_asked_for_and_given(supply, gate):
    supply.send_hints(3.0)
    assert gate.hints_s == 3
    gate.says.append(Hinted(HINT))
    assert outcomes(supply) == [Hinted(HINT)]


def test_the_gates_thread_ends_with_the_sensor(supply, sensor, gate):
    sensor.close = lambda: gate.closed
    assert supply.close()


class FakeJudge:
    """Finds nobody in the first frames."""

    def __init__(self, *_):
        self.bad = 2
        self.judged = []

    def judge(self, frame):
        self.judged.append(frame)
        return NOBODY if len(self.judged) <= self.bad else GOOD


@pytest.fixture
def recording(monkeypatch):
    monkeypatch.setattr(frame_judge, "FrameJudge", FakeJudge)
    monkeypatch.setattr(_reader_supply, "time", SimpleNamespace(
        monotonic=lambda: 100.0, sleep=lambda _: None))
    supply = ReaderSupply(FakeReader(live=False), Driver(), 1.0)
    ended(supply)
    return supply


def ended(supply):
    """Let the driver's call end, and give what comes of it."""
    supply._driver.call_done = True
    return outcomes(supply)


def test_of_a_recording_who_waits_gets_the_first_good_frame(recording):
    press(recording)
    outcomes(recording)
    assert [len(ended(recording)) for _ in range(3)] == [0, 0, 1]
    assert len(recording._judge.judged) == 3


def test_of_a_recording_the_next_frame_is_refused_where_it_is_not_good(recording):
    press(recording, gate="refuse")
    outcomes(recording)
    assert ended(recording) == [NotTaken("a", "step in front of the camera", HINT)]


def test_who_waits_for_a_recording_gives_up(recording):
    press(recording, gate_timeout=0)
    outcomes(recording)
    assert ended(recording) == [NotTaken("a", "step in front of the camera", HINT)]


def test_of_a_recording_the_best_frame_is_taken(recording, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(_reader_supply.time, "monotonic", lambda: clock[0])
    says = deque(Hinting().judge(seen(motion_mm=moved), 0.0) for moved in (9.0, 5.0, 8.0, 7.0))
    judged = []
    recording._judge.judge = lambda frame: judged.append(frame) or says.popleft()
    press(recording, gate="best", gate_timeout=1)
    outcomes(recording)
    taken = []
    while not taken:
        clock[0] += 0.3
        taken = ended(recording)
    assert taken[0].frame is judged[1]
    assert len(judged) == 4


def test_a_press_without_a_gate_goes_before_one_that_waits_for_a_recording(recording):
    press(recording)
    press(recording, capture_id="b", gate="off")
    outcomes(recording)
    assert ended(recording) == []
    (taken,) = ended(recording)
    assert taken.capture_id == "b"
    assert len(recording._judge.judged) == 1


def test_a_hint_of_a_recording_is_of_the_frame_that_a_press_gives_next(recording):
    recording.send_hints(3.0)
    outcomes(recording)
    assert ended(recording) == [Hinted(HINT)]
    assert outcomes(recording) == []
    recording.preview()
    outcomes(recording)
    (picture,) = ended(recording)
    assert picture.hint is HINT
    assert recording._reader.calls == ["peek", "peek"]
