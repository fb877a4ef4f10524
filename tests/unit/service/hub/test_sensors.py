"""Several sensors: which one a press goes to, what they say of themselves, what the gate says."""

import pytest

from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.sensor_messages import SensorFigures
from tests.unit.service.hub.bench import CLIENT, FRAME, FRAME_ARRAYS, OTHER, SENSOR, kinds

HINT = Hint(timestamp_us=4, codes=("too_far",), text="come closer")


def state(bench, state, peer=SENSOR, name="s", **more):
    return bench.say(peer, messages.SensorState(name=name, state=state, **more))


def press(bench, capture_id="a", **more):
    return bench.say(CLIENT, messages.Press(request=7, capture_id=capture_id, **more))


def asked(sent):
    return [peer for peer, kind in kinds(sent) if kind == "take"]


@pytest.mark.parametrize(("of_sensor", "of_other", "taker"), [
    ("streaming", "streaming", SENSOR), ("warming", "streaming", OTHER),
    ("opening", "warming", OTHER), ("stalled", "opening", OTHER), ("absent", "warming", OTHER)])
def test_without_a_name_the_sensor_that_is_best_off_is_asked(bench, of_sensor, of_other, taker):
    state(bench, of_sensor)
    state(bench, of_other, OTHER, "o")
    assert asked(press(bench)) == [taker]


def test_the_sensor_of_the_name_is_asked(bench):
    state(bench, "streaming")
    state(bench, "warming", OTHER, "o")
    assert asked(press(bench, sensor="o")) == [OTHER]
    assert asked(press(bench, "b", sensor="s")) == [SENSOR]


def test_a_name_that_nobody_has_is_refused_with_the_names_that_there_are(bench):
    state(bench, "streaming")
    state(bench, "blocked", OTHER, "o", reason="no permission")
    ((_, refused),) = press(bench, sensor="kinect")
    assert (refused.reason, refused.message) == (
        "no_sensor", "no sensor kinect is connected; there: o, s")
    ((_, refused),) = press(bench, "b", sensor="o")
    assert refused.message == "the sensor o is blocked: no permission"


@pytest.mark.parametrize("now", ["absent", "blocked", "stalled", "closing"])
def test_a_press_hears_at_once_why_no_sensor_streams(bench, now):
    state(bench, now, reason="the driver says so")
    ((_, refused),) = press(bench)
    assert (refused.kind, refused.reason) == ("press_refused", "no_sensor")
    assert refused.message == f"the sensor s is {now}: the driver says so"


def test_of_two_with_one_name_the_later_is_asked(bench):
    """The earlier is likely a process that died and is not silent for long enough yet."""
    state(bench, "streaming")
    state(bench, "streaming", OTHER)
    assert asked(press(bench, sensor="s")) == [OTHER]


def test_one_that_gave_no_frame_in_time_is_asked_last_until_it_gives_one(bench):
    state(bench, "streaming")
    state(bench, "opening", OTHER, "o")
    assert asked(press(bench)) == [SENSOR]
    for _ in range(11):
        bench.say(SENSOR, messages.Heartbeat())
        bench.say(OTHER, messages.Heartbeat())
        bench.wait(1.0)
    assert asked(press(bench, "b")) == [OTHER]
    assert asked(press(bench, "c", sensor="s")) == [SENSOR]
    bench.frame("c")
    assert asked(press(bench, "d")) == [SENSOR]


def test_what_a_sensor_says_of_itself_stands_in_the_status(bench):
    bench.sensor()
    figures = SensorFigures(frames=9, drops=2, skew_us=1500)
    state(bench, "blocked", OTHER, "o", reason="busy\n" * 100, identity="usb 1-2",
          figures=figures)
    ((_, status),) = bench.say(CLIENT, messages.GetStatus(request=1))
    assert status.sensors == ("s",)
    first, second = status.sensor_states
    assert (first.name, first.state) == ("s", "streaming")
    assert (second.state, second.identity, second.figures) == ("blocked", "usb 1-2", figures)
    assert len(second.reason) == 200
    assert second.reason.isprintable()


@pytest.mark.parametrize(("now", "frames"), [
    ("streaming", True), ("warming", True), ("opening", False), ("blocked", False)])
def test_a_service_is_ready_when_a_sensor_has_frames(bench, now, frames):
    bench.worker()
    state(bench, now)
    state(bench, "absent", OTHER, "o")
    ((_, status),) = bench.say(CLIENT, messages.GetStatus(request=1))
    assert (status.ready, status.has_frames) == (frames, frames)
    assert [one.name for one in status.sensor_states] == ["s", "o"]


def test_a_sensor_that_is_known_by_its_state_alone_gives_frames_and_goes(bench):
    state(bench, "streaming")
    press(bench)
    assert "press_accepted" in [kind for _, kind in kinds(bench.frame())]
    bench.say(SENSOR, messages.Goodbye())
    ((_, refused),) = press(bench, "b")
    assert refused.message == "no sensor is connected"


def test_a_sensor_that_says_it_is_ready_stays_in_the_state_it_named(bench):
    state(bench, "warming")
    bench.sensor()
    ((_, status),) = bench.say(CLIENT, messages.GetStatus(request=1))
    assert [one.state for one in status.sensor_states] == ["warming"]


def test_gate_and_burst_are_passed_on(bench):
    bench.sensor()
    ((_, take),) = press(bench, gate="wait", gate_timeout=3.0, frames=4)
    assert (take.gate, take.gate_timeout, take.frames) == ("wait", 3.0, 4)


def test_a_gated_press_waits_for_as_much_longer(bench):
    bench.sensor()
    press(bench, gate="wait", gate_timeout=30.0)
    press(bench, "b", gate="refuse", gate_timeout=30.0)
    for _ in range(12):
        bench.say(SENSOR, messages.Heartbeat())
        late = bench.wait(1.0)
        if late:
            break
    ((_, refused),) = late
    assert (refused.capture_id, refused.reason) == ("b", "timeout")
    for _ in range(29):
        bench.say(SENSOR, messages.Heartbeat())
        assert bench.wait(1.0) == []
    bench.say(SENSOR, messages.Heartbeat())
    ((_, refused),) = bench.wait(1.5)
    assert refused.message == "no frame from the sensor in 40 s"


def test_a_frame_that_is_not_good_enough_refuses_the_press_with_its_hint(bench):
    bench.sensor()
    press(bench, gate="refuse")
    ((_, refused),) = bench.say(SENSOR, messages.FrameFailed(
        capture_id="a", message="come closer", reason="quality", hint=HINT))
    assert (refused.reason, refused.message, refused.hint) == ("quality", "come closer", HINT)
    assert press(bench) == [(CLIENT, refused)]  # a repeat is answered the same


def test_only_so_many_sensors_are_taken_by_their_states_too(bench):
    for number in range(300):
        said = state(bench, "absent", b"%d" % number, f"n{number}")
    assert kinds(said) == [(b"299", "denied")]
    ((_, status),) = bench.say(CLIENT, messages.GetStatus(request=1))
    assert len(status.sensor_states) == 64


def test_a_frame_of_the_other_sensor_is_not_taken_for_the_press(bench):
    state(bench, "streaming")
    state(bench, "streaming", OTHER, "o")
    press(bench, sensor="o")
    assert kinds(bench.frame()) == [(SENSOR, "frame_refused")]
    sent = bench.say(OTHER, messages.Frame(capture_id="a", frame=FRAME), FRAME_ARRAYS)
    assert "press_accepted" in [kind for _, kind in kinds(sent)]
