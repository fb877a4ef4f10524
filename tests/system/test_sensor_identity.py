"""Sensors by serial number, USB port or URI; their calibrations; their exposure."""

import json
import subprocess
import sys

import numpy as np
import pytest

from tests.simulator import KINECT_DEFAULT
from tests.system.running import REPOSITORY, killed_at_the_end
from tests.unit.usb import plug
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control, Driver
from tests.virtual_sensor.process import environment, run_python
from tests.virtual_sensor.scenes import cheap_frames
from tests.waiting import LIMIT_S

DEPTH, COLOR = cheap_frames(1)[0]
_OPEN = """
import json, sys
from pathlib import Path
from denseface.capture import open_source
from denseface.capture.errors import SensorError
from denseface.capture.identity import usb_devices
from denseface.capture.openni2 import _devices
_devices.usb_devices = lambda: usb_devices(Path(sys.argv[1]))
for name in sys.argv[2:]:
    try:
        with open_source(f"openni2:{name}") as source:
            frame = next(iter(source))
            print(json.dumps([source.known_as.uri, frame.origin.sensor, frame.calibration_origin]))
    except SensorError as error:
        print(json.dumps(str(error)))
"""


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, [(DEPTH, COLOR)], calibration=KINECT_DEFAULT.calibration)
    return path


@pytest.fixture
def pair(tmp_path, clip):
    """Two sensors of a kind, on two ports."""
    made = []
    for port, number, serial in (("1-1", 7, "A1"), ("1-2", 8, "B2")):
        plug(tmp_path / "usb", port, "1d27", "0601", 1, number)
        made.append(Control(tmp_path / port, clip, uri=f"1d27/0601@1/{number}", serial=serial))
    yield made
    for control in made:
        control.close()


def opened(tmp_path, sensors, *names, **variables):
    done = run_python(_OPEN, tmp_path / "usb", *names,
                      env=environment(controls=sensors) | variables)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_sensor_is_found_by_what_it_is_known_by(pair, tmp_path):
    both = ["1d27/0601@1/7", "1d27/0601@1/8"]
    said = opened(tmp_path, pair, "B2", "A1", "1-2", "1d27/0601@1/7", "", "C3")
    assert [one[:2] for one in said[:-1]] == [
        [both[1], "B2"], [both[0], "A1"], [both[1], "B2"], [both[0], "A1"], [both[0], "A1"]]
    assert said[-1] == ("openni2:C3: no such sensor; found: 1d27/0601@1/7 (serial A1, USB port "
                        "1-1), 1d27/0601@1/8 (serial B2, USB port 1-2)")


@pytest.mark.parametrize("serial", ["", "0000000000000000"])
def test_two_sensors_that_have_no_number_of_their_own_go_by_their_ports(pair, tmp_path, serial):
    for sensor in pair:
        sensor.serial = serial
    said = opened(tmp_path, pair, "1-2", "1-1", "S1")
    assert [one[1] for one in said[:2]] == ["1-2", "1-1"]
    assert said[2].startswith("openni2:S1: no such sensor; found: 1d27/0601@1/7 (USB port 1-1)")


def test_a_calibration_is_found_by_the_sensor(pair, tmp_path):
    folder = tmp_path / "calibrations"
    folder.mkdir()
    text = KINECT_DEFAULT.calibration.to_json()
    (folder / "B2.calibration.json").write_text(text)
    (folder / "1-1.calibration.json").write_text(text)
    said = opened(tmp_path, pair, "A1", "B2", DENSEFACE_CALIBRATIONS=str(folder))
    assert [one[2] for one in said] == [
        "by USB port: 1-1.calibration.json", "by serial: B2.calibration.json"]
    (folder / "A1.calibration.json").write_text("{}")
    done = run_python(_OPEN, tmp_path / "usb", "A1", env=environment(controls=pair)
                      | {"DENSEFACE_CALIBRATIONS": str(folder)})
    assert "A1.calibration.json: depth: Field required" in done.stderr


def test_a_sensor_comes_back_under_another_uri(pair, tmp_path):
    """A replug changes PrimeSense's URIs; the other sensor is not taken for it."""
    code = f"""
import sys, time
sys.argv[1:] = [{str(tmp_path / 'usb')!r}]
{_OPEN.partition("for name")[0]}
from denseface.capture.openni2 import WatchedSensor
sensor = WatchedSensor("1d27/0601@1/8")
def until(true):
    end = time.monotonic() + 40
    while not true() and time.monotonic() < end: time.sleep(0.02)
    print(bool(true()), flush=True)
until(lambda: sensor.latest())
print(sensor.identity, flush=True)
sys.stdin.readline()
until(lambda: sensor.state.value == "absent")
sys.stdin.readline()
until(lambda: sensor.latest())
print(sensor.latest().frame.origin.sensor, sensor.close(), flush=True)
"""
    with killed_at_the_end(subprocess.Popen(
            [sys.executable, "-c", code], env=environment(controls=pair), cwd=REPOSITORY,
            text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)) as process:
        def go_on():
            process.stdin.write("\n")
            process.stdin.flush()

        assert [process.stdout.readline().strip() for _ in range(2)] == ["True", "B2"]
        pair[1].unplug()
        go_on()
        assert process.stdout.readline() == "True\n"
        pair[1].replug("1d27/0601@1/9")
        go_on()
        assert [process.stdout.readline().strip() for _ in range(2)] == ["True", "B2 True"]
        assert process.wait(LIMIT_S) == 0
    assert pair[0].depth.frames == 0


_EXPOSE = """
import json, sys
from itertools import islice
from denseface.capture.openni2 import LiveSource
with LiveSource() as source:
    means = lambda count: [frame.rgb.mean() for frame in islice(source, count)]
    settled = next(iter(source)).rgb.mean(axis=(0, 1)).tolist()
    free = means(12)
    source.lock_exposure(on=True)
    means(2)
    locked = means(12)
    notes = next(iter(source)).origin.notes
    source.lock_exposure(on=False)
    means(2)
    print(json.dumps([settled, free, locked, notes, means(12)]))
"""


@pytest.fixture
def sensor(tmp_path, clip):
    with Control(tmp_path / "sensor", clip) as control:
        yield control


def exposed(sensor):
    done = run_python(_EXPOSE, env=environment(controls=[sensor]))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_first_frame_is_as_bright_as_those_after_it(sensor):
    sensor.settle_frames = 25
    settled, *_ = exposed(sensor)
    np.testing.assert_allclose(settled, COLOR.mean(axis=(0, 1)), rtol=0.02)


def test_the_exposure_is_locked_and_set_free(sensor):
    sensor.breathing_per_mille = 150
    _, free, locked, notes, after = exposed(sensor)
    assert np.ptp(locked) < 1 < min(np.ptp(free), np.ptp(after))
    assert not any("could not be locked" in note for note in notes)


@pytest.mark.parametrize(("driver", "controls", "missing"), [
    (Driver.FREENECT, True, "exposure"), (Driver.PRIMESENSE, False, "exposure and white balance")])
def test_what_cannot_be_locked_is_a_note_of_the_frame(sensor, driver, controls, missing):
    sensor.driver, sensor.camera_controls = driver, controls
    sensor.uri = "freenect://0" if driver is Driver.FREENECT else "virtual:0"
    *_, notes, _ = exposed(sensor)
    assert f"the {missing} of the color camera could not be locked" in notes
