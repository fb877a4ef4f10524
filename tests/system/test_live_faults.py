"""What a live sensor does wrong, and that it costs no more than it must: each on the real library.

The sensor looks after itself here as in the capture process; `test_live_service` has the service.
"""

import shutil
import signal
import time
from itertools import pairwise

import numpy as np
import pytest

from denseface.capture.live.clock import TRANSPORT_S
from tests.system.watched_sensor import Watched
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control, DeviceState, Format, Mode, OpenFault, Stamps
from tests.virtual_sensor.process import environment
from tests.waiting import until

PERIOD_S = 1 / 30


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Three images, each with its own noise."""
    rng = np.random.default_rng(7)
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, [(rng.integers(500, 900, (480, 640), np.uint16),
                       rng.integers(0, 256, (480, 640, 3), np.uint8)) for _ in range(3)])
    return path


@pytest.fixture
def control(clip, tmp_path):
    with Control(tmp_path / "control", clip, marks=True) as control:
        yield control


@pytest.fixture
def sensor(control):
    with Watched(environment(controls=[control])) as sensor:
        yield sensor


def stale(presses):
    return [press for press in presses if min(press["exposed_s"]) < press["asked_s"]]


@pytest.mark.parametrize("pipeline_us", [0, 33_000, 66_000])
def test_every_press_gets_a_frame_that_was_exposed_after_it(control, sensor, pipeline_us):
    control.pipeline_us = pipeline_us
    sensor.wait_state("streaming")
    presses = sensor.presses(40)
    assert not stale(presses)
    for press in presses:
        assert press["earliest_s"] <= min(press["exposed_s"])
        assert (press["exposure_known_by"], press["skew_known_by"]) == ("stamps", "stamps")


def test_a_press_while_the_stream_is_frozen_gets_no_old_frame(control, sensor):
    sensor.wait_state("streaming")
    assert not stale([sensor.press()])
    for stream in (control.depth, control.color):
        stream.frozen = True
    control.wait_frames(2)
    press = sensor.press()
    assert press["state"] in ("closing", "absent"), press
    assert "has fallen silent or repeats itself" in press["refused"]
    for stream in (control.depth, control.color):
        stream.frozen = False
    sensor.wait_state("streaming")
    assert not stale([sensor.press()])


@pytest.mark.parametrize("which", ["depth", "color", "both"])
def test_silence_without_a_word_is_noticed(control, sensor, which):
    sensor.wait_state("streaming")
    streams = [control.depth, control.color] if which == "both" else [getattr(control, which)]
    for stream in streams:
        stream.silent = True
    press = sensor.press()
    if "refused" not in press:  # it was on its way
        press = sensor.press()
    assert "fallen silent" in press["refused"]
    assert ("stream" in press["refused"]) == (which != "both")
    assert sensor.ask("figures")["stalls"] == 1
    for stream in streams:
        stream.silent = False
    sensor.wait_state("streaming")
    assert not stale([sensor.press()])


def test_an_unplugged_sensor_is_noticed_and_taken_again_under_any_uri(control, sensor):
    sensor.wait_state("streaming")
    for number in range(1, 3):
        control.unplug()
        sensor.wait_state("absent")
        assert "was unplugged or failed" in sensor.press()["refused"]
        control.replug(f"virtual:{number}")
        sensor.wait_state("streaming")
        assert sensor.ask("identity") == f"virtual:{number}"
        assert not stale([sensor.press()])
    assert sensor.ask("figures")["reconnects"] == 2
    assert control.loads == 1  # in the same process


def test_who_pulls_it_out_while_it_warms_up_waits_no_longer_for_it(control, sensor):
    sensor.ask("pause", 1000)
    for number in range(1, 4):
        sensor.wait_state("warming", "streaming")
        control.unplug()
        sensor.wait_state("absent")
        control.replug(f"virtual:{number}")
    sensor.wait_state("warming", "streaming")


def test_a_loop_of_disconnects_is_named(control, sensor):
    for _ in range(3):
        sensor.wait_state("streaming")
        control.unplug()
        sensor.wait_state("absent")
        control.replug()
    control.unplug()
    reason = until(lambda: next((reason for state, reason, _ in sensor.ask("history")
                                 if "lost 3 times and more within a minute" in reason), None))
    assert "cable" in reason


def test_short_glitches_are_waited_out(control, sensor):
    sensor.wait_state("streaming")
    for number in range(1, 4):
        for stream in (control.depth, control.color):
            stream.silent = True
        until(lambda wanted=number: sensor.ask("figures")["stalls"] == wanted)
        for stream in (control.depth, control.color):
            stream.silent = False
        sensor.wait_state("streaming")
    assert control.loads == 1


def test_a_machine_that_stands_still_hears_of_no_silence(control, sensor):
    since_s = sensor.wait_state("streaming")
    for _ in range(3):
        control.wait_frames(4)
        sensor.process.send_signal(signal.SIGSTOP)
        time.sleep(0.7)  # longer than a silence takes to be noticed
        sensor.process.send_signal(signal.SIGCONT)
    assert not stale(sensor.presses(3))
    assert sensor.states_since(since_s + 1e-6) == []
    assert sensor.ask("figures")["stalls"] == 0


def test_a_frame_of_a_wrong_size_is_dropped_and_counted(control, sensor):
    sensor.wait_state("streaming")
    control.depth.wrong_size_next = 1
    control.color.wrong_size_next = 2
    until(lambda: sensor.ask("figures")["wrong_size"] == 3)
    assert not stale(sensor.presses(3))
    assert control.opens == 1


def test_an_error_state_for_a_moment_is_waited_out(control, sensor):
    since_s = sensor.wait_state("streaming")
    control.state = DeviceState.ERROR
    control.wait_frames(6)
    control.state = DeviceState.OK
    control.wait_frames(6)
    assert not stale(sensor.presses(3))
    assert sensor.states_since(since_s + 1e-6) == []
    assert control.opens == 1


@pytest.mark.parametrize(("fault", "words"), [
    (OpenFault.BUSY, "cannot be opened"), (OpenFault.NO_PERMISSION, "cannot be opened")])
def test_a_sensor_that_cannot_be_had_is_waited_for(control, sensor, fault, words):
    sensor.wait_state("streaming")
    control.open_fault = fault
    control.unplug()
    sensor.wait_state("absent")
    control.replug()
    sensor.wait_state("blocked")
    assert words in sensor.press()["refused"]
    control.open_fault = OpenFault.NONE
    sensor.wait_state("streaming")


def test_no_sensor_is_said_and_waited_for(clip, tmp_path):
    with Control(tmp_path / "none", clip, marks=True, plugged=False) as control, \
            Watched(environment(controls=[control])) as sensor:
        until(lambda: "OpenNI2 finds no sensor" in sensor.ask("state")[1])
        assert "no sensor" in sensor.press()["refused"]
        control.replug()
        sensor.wait_state("streaming")
        assert not stale(sensor.presses(3))


@pytest.mark.parametrize(("depth_fps", "color_fps", "delay_us", "apart_s"), [
    (60, 30, 0, 1 / 120), (30, 60, 0, 1 / 120), (60, 15, 5_000, 1 / 120),
    (15, 15, 33_333, 1 / 30), (60, 60, 0, 1 / 120)])
def test_streams_of_any_rate_are_paired_by_the_nearest_exposure(
    control, sensor, depth_fps, color_fps, delay_us, apart_s
):
    control.depth.offer(Mode(fps=depth_fps))
    control.color.offer(Mode(fps=color_fps, format=Format.RGB888))
    control.color.delay_us = delay_us
    control.unplug()  # modes are read when it is opened
    sensor.wait_state("absent")
    control.replug()
    sensor.wait_state("streaming")
    seen = 0
    while seen < 10:
        press = sensor.press(seen)
        assert not stale([press])
        depth_s, color_s = press["exposed_s"]
        # A busy machine loses frames, and what is lost cannot be the nearest.
        since_s = min(depth_s, color_s) - 1.2 / min(depth_fps, color_fps)
        if press["skew_known_by"] == "stamps" and all(
                b - a < 1.5 / fps for kind, fps in (("depth", depth_fps), ("color", color_fps))
                for a, b in pairwise(press["arrived_s"][kind]) if b > since_s):
            seen += 1
            assert abs(depth_s - color_s) < 1.06 * apart_s + 1e-3
            assert press["skew_us"] / 1e6 == pytest.approx(depth_s - color_s, abs=1e-3)


@pytest.mark.parametrize(("stamps", "offset_us", "note"), [
    (Stamps.SENSOR, 1_000_000, "1000 ms ahead of"), (Stamps.SENSOR, -500_000, "500 ms behind"),
    (Stamps.NONE, 0, "do not advance"), (Stamps.EPOCH, 0, "ahead of")])
def test_clocks_that_differ_are_paired_by_arrival(control, sensor, stamps, offset_us, note):
    control.color.stamps, control.color.stamp_offset_us = stamps, offset_us
    sensor.wait_state("streaming")
    presses = sensor.presses(10)
    assert not stale(presses)
    for press in presses:
        depth_s, color_s = press["exposed_s"]
        assert abs(depth_s - color_s) < PERIOD_S
        assert press["skew_known_by"] == "arrival"
        assert abs(press["skew_us"]) < PERIOD_S * 1e6
        assert "color stream" in press["notes"][0]
    if offset_us:
        assert note.split()[-1] in presses[0]["notes"][0]
    else:
        assert note in presses[0]["notes"][0]


@pytest.mark.parametrize("stamps", [Stamps.NONE, Stamps.MILLISECONDS, Stamps.ARRIVAL])
def test_stamps_of_any_kind_give_no_old_frame(control, sensor, stamps):
    control.pipeline_us = 33_000
    control.depth.stamps = control.color.stamps = stamps
    sensor.wait_state("streaming")
    presses = sensor.presses(20)
    # A busy machine delivers later than any sensor does; only a clock of the sensor's tells.
    assert not [press for press in stale(presses) if stamps is Stamps.MILLISECONDS
                or press["latest_s"] - min(press["exposed_s"]) <= TRANSPORT_S]
    known = {Stamps.NONE: "arrival"}.get(stamps, "stamps")
    if sensor.ask("figures")["clock_jumps"]:
        # Of a busy machine that delivered two frames at once, by whose stamps time jumped.
        until(lambda: sensor.press()["exposure_known_by"] == known)
    else:
        assert {press["exposure_known_by"] for press in presses} == {known}


def test_a_clock_that_jumps_costs_no_old_frame(control, sensor):
    sensor.wait_state("streaming")
    for stream in (control.depth, control.color):
        stream.stamp_offset_us = 700_000
    presses = sensor.presses(10)
    for stream in (control.depth, control.color):
        stream.stamp_offset_us = 0
    presses += sensor.presses(10)
    assert not stale(presses)
    assert sensor.ask("figures")["clock_jumps"] >= 2
    assert control.opens == 1


def test_a_burst_is_of_frames_that_follow_each_other(control, sensor):
    sensor.wait_state("streaming")
    numbers = sensor.ask("burst", 4)
    assert numbers == sorted(set(numbers))


def test_a_sensor_that_linux_lists_and_openni2_does_not_needs_a_new_process(
    control, clip, tmp_path
):
    """As where the system does not tell the driver: in a container, or with Freenect's."""
    usb = tmp_path / "usb"

    def plug(number):
        (usb / "1-4").mkdir(parents=True)
        for name, text in (("idVendor", "1d27"), ("idProduct", "0601"), ("busnum", "1"),
                           ("devnum", str(number))):
            (usb / "1-4" / name).write_text(text + "\n")

    control.hotplug = False
    plug(7)
    env = environment(controls=[control]) | {"FAKE_USB_DEVICES": str(usb)}
    with Watched(env) as sensor:
        sensor.wait_state("streaming")
        control.unplug()
        shutil.rmtree(usb / "1-4")
        sensor.wait_state("stalled", "closing", "absent")
        control.replug()
        plug(8)
        assert "Xtion 1d27:0601 at port 1-4 was plugged in" in until(lambda: sensor.ask("stuck"))


def test_who_asked_is_told_of_the_next_pair_whatever_was_given(sensor):
    sensor.wait_state("streaming")
    for _ in range(3):
        assert sensor.ask("told_again")


def test_lost_frames_are_counted(control, sensor):
    sensor.wait_state("streaming")
    before = sensor.ask("figures")["drops"]
    control.depth.drop_next = 3
    until(lambda: sensor.ask("figures")["drops"] >= before + 3)
