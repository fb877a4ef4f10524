"""A live sensor's frames for presses and previews: what waits, what is refused."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from denseface.capture.errors import MismatchedFrameError
from denseface.capture.live.sensor import Shot
from denseface.capture.live.states import LiveFigures, LiveState
from denseface.service.daemons import _live_supply
from denseface.service.daemons._live_supply import LiveSupply
from denseface.service.daemons._supply import NotTaken, Picture, Taken
from denseface.service.protocol.messages import Take
from tests.unit.service.faces import small_frame
from tests.waiting import until


class FakeSensor:
    """Gives the shots it is told of."""

    uri, identity = "fake:", "A7"

    def __init__(self):
        self.state, self.reason = LiveState.STREAMING, ""
        self.figures = LiveFigures(frames=3, skew_us=-12)
        self.shots = []
        self.locked = []

    def lock_exposure(self, *, on):
        if [on] != self.locked[-1:]:
            self.locked.append(on)

    def shoot(self, at_s):
        self.shots.append(Shot(small_frame(), len(self.shots) + 1, at_s, at_s + 0.03))

    def latest(self):
        return self.shots[-1] if self.shots else None

    def first_after(self, after_s, *, closely=False):
        self.closely = closely
        return next((shot for shot in self.shots if shot.earliest_s >= after_s), None)

    def needs_new_process(self):
        return ""


@pytest.fixture
def sensor():
    return FakeSensor()


@pytest.fixture
def now(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(_live_supply, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    return clock


@pytest.fixture
def supply(sensor, now):
    supply = LiveSupply(sensor, 5.0)
    yield supply
    supply.wake.close()


def outcomes(supply, **options):
    return list(supply.step(**{"busy": False} | options))


def test_a_pair_that_does_not_belong_together_is_refused(supply, sensor):
    def first_after(after_s, *, closely):
        assert closely
        raise MismatchedFrameError("fake:: depth and colour do not belong together")

    sensor.first_after = first_after
    supply.press(Take(capture_id="a"))
    (refused,) = outcomes(supply)
    assert (refused.capture_id, refused.reason) == (
        "a", "fake:: depth and colour do not belong together")
    assert outcomes(supply) == []


def test_a_press_gets_the_first_pair_after_it(supply, sensor):
    sensor.shoot(99.99)
    supply.press(Take(capture_id="a"))
    assert outcomes(supply) == []
    sensor.shoot(100.02)
    sensor.shoot(100.05)
    (taken,) = outcomes(supply)
    assert isinstance(taken, Taken)
    assert taken.frame.origin.exposed_after_press_ms == pytest.approx(20)
    assert outcomes(supply) == []


def test_a_repeated_press_keeps_its_time(supply, sensor, now):
    supply.press(Take(capture_id="a"))
    now[0] += 1
    supply.press(Take(capture_id="a"))
    sensor.shoot(100.5)
    assert len(outcomes(supply)) == 1


@pytest.mark.parametrize("state", [
    LiveState.ABSENT, LiveState.BLOCKED, LiveState.CLOSING])
def test_without_a_sensor_a_press_is_refused_at_once_with_the_reason(supply, sensor, state):
    sensor.state, sensor.reason = state, "it was unplugged"
    supply.press(Take(capture_id="a"))
    assert outcomes(supply) == [NotTaken("a", "it was unplugged")]


@pytest.mark.parametrize("state", [LiveState.OPENING, LiveState.WARMING, LiveState.STALLED])
def test_while_there_is_hope_a_press_waits_but_not_for_ever(supply, sensor, now, state):
    sensor.state, sensor.reason = state, "it is warming up"
    supply.press(Take(capture_id="a"))
    now[0] += 4.9
    assert outcomes(supply) == []
    now[0] += 0.2
    (refused,) = outcomes(supply)
    assert refused == NotTaken("a", "no frame within 5.1 s: it is warming up")


def test_a_burst_takes_pairs_that_follow_each_other(supply, sensor):
    supply.press(Take(capture_id="a", frames=3))
    for at_s in (100.0, 100.033):
        sensor.shoot(at_s)
    assert outcomes(supply) == []
    assert sensor.locked == [True]
    sensor.shoot(math.nextafter(100.033, math.inf))
    (taken,) = until(lambda: outcomes(supply))
    assert taken.frame.origin.fused == 3
    assert taken.frame.origin.notes == ()
    assert sensor.locked == [True, False]


def test_frames_that_a_burst_missed_are_a_note(supply, sensor):
    supply.press(Take(capture_id="a", frames=2))
    sensor.shoot(100.0)
    outcomes(supply)
    sensor.shots.append(replace(sensor.shots[-1], number=4, earliest_s=100.1))
    (taken,) = until(lambda: outcomes(supply))
    assert taken.frame.origin.notes == ("2 frames between those of the burst were lost",)


def test_a_preview_shows_the_newest_pair_once(supply, sensor):
    sensor.shoot(99.0)
    supply.preview()
    assert outcomes(supply, busy=True) == []
    (shown,) = outcomes(supply)
    assert isinstance(shown, Picture)
    supply.preview()
    assert outcomes(supply) == []
    sensor.shoot(99.1)
    assert len(outcomes(supply)) == 1
    assert outcomes(supply) == []


def test_a_preview_of_a_sensor_opened_anew_is_shown(supply, sensor):
    for at_s in (98.0, 99.0):
        sensor.shoot(at_s)
    supply.preview()
    outcomes(supply)
    sensor.shots.clear()
    sensor.shoot(100.0)
    supply.preview()
    assert len(outcomes(supply)) == 1


def test_the_state_is_that_of_the_sensor(supply, sensor):
    sensor.state, sensor.reason = LiveState.STALLED, "silent" + 1000 * "!"
    state = supply.state
    assert (state.state, state.identity, state.figures.frames) == ("stalled", "A7", 3)
    assert (len(state.reason), state.figures.skew_us) == (500, 12)
    assert replace(state, reason="") != state
