"""`denseface doctor` before virtual sensors that are well, hang, are busy, or are not there."""

import json

import pytest

from tests.system.running import denseface
from tests.unit.usb import plug
from tests.virtual_sensor import presets
from tests.virtual_sensor.control import Call, Control, OpenFault
from tests.virtual_sensor.process import environment, run_python
from tests.virtual_sensor.scenes import cheap_clip
from tests.waiting import LIMIT_S

_RUN = """
import sys
from pathlib import Path
from denseface.service.client import Client
from denseface.service.tools import doctor
folder = Path(sys.argv[1])
sys.exit(doctor.run(None, lambda: Client(f"ipc://{folder}/nobody"), as_json_object=True,
                    usb_root=folder / "usb", root=folder, limit_s=float(sys.argv[2])))
"""


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return cheap_clip(tmp_path_factory.mktemp("clip") / "clip", 3)


@pytest.fixture
def sensor(tmp_path, clip):
    plug(tmp_path / "usb", "1-4", "1d27", "0601", 1, 7)
    for name in ("run/udev/control", "dev/bus/usb/001/007"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    with Control(tmp_path / "sensor", clip) as control:
        presets.as_xtion(control)
        yield control


def examined(tmp_path, sensors, limit_s=LIMIT_S):
    """Give the exit status, and the findings by what was looked at."""
    done = run_python(_RUN, tmp_path, limit_s, env=environment(controls=sensors))
    assert done.stderr == ""
    findings = {}
    for finding in json.loads(done.stdout)["findings"]:
        findings.setdefault(finding["what"], []).append((finding["level"], finding["text"]))
    return done.returncode, findings


def test_a_sensor_that_is_well_and_one_without_color(sensor, clip, tmp_path):
    with Control(tmp_path / "other", clip) as other:
        presets.as_structure_sensor(other)
        status, findings = examined(tmp_path, [sensor, other])
    said = [text for _, text in findings["1206120123"]]
    assert said[0] == ("1d27/0601@1/7, depth 640x480 at 30/s as DEPTH_1_MM (of 6), "
                       "color 640x480 at 30/s as RGB888 (of 8)")
    assert said[1].endswith("of the image, not registered")
    assert "ms apart, by" in said[2]
    assert said[3].startswith("calibration: device: ZPD 120, ZPPS 0.1042, DCRCDIS 2.3")
    assert findings["24817"][0] == ("ok", "1d27/0600@1/9, depth 640x480 at 30/s as DEPTH_1_MM "
                                    "(of 6), no color camera")
    assert findings["USB 1-4"] == [("ok", "Xtion, 1d27:0601, 480 Mbit/s")]
    assert [level for level, _ in findings["OpenNI2"] + findings["sensor"]] == ["ok"] * 3
    assert findings["hub"][0][0] == "warning"
    # The private folder of the virtual sensor has no PS1080 driver.
    assert findings["drivers"][1] == ("problem", "no PS1080 driver for the Xtion at USB 1-4")
    assert status == 1


def test_a_driver_that_hangs_is_given_up(sensor, tmp_path):
    sensor.hang = Call.START
    status, findings = examined(tmp_path, [sensor], 6.0)
    sensor.hang = Call.NONE
    assert status == 1
    assert findings["1d27/0601@1/7"] == [
        ("problem", "hangs while it is opened (given up after 6 s)")]


def test_a_sensor_that_another_program_has(sensor, tmp_path):
    sensor.open_fault = OpenFault.BUSY
    status, findings = examined(tmp_path, [sensor])
    assert status == 1
    ((level, text),) = findings["1d27/0601@1/7"]
    assert level == "problem"
    assert "cannot be opened" in text


def test_the_command_without_a_sensor(tmp_path):
    done = denseface("doctor", "--address", f"ipc://{tmp_path}/nobody", **environment())
    assert (done.returncode, done.stderr) == (1, "")
    assert "problem  sensor: OpenNI2 lists none" in done.stdout
    assert f"warning  hub: ipc://{tmp_path}/nobody: no answer" in done.stdout
    # A wrong address is a finding like any other.
    done = denseface("doctor", "--address", "udp://", **environment())
    assert "problem  sensor: OpenNI2 lists none" in done.stdout
    assert "problem  hub: udp://" in done.stdout
