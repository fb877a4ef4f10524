"""What the doctor makes of a machine, and of what OpenNI2 answers; nothing is opened here."""

import json
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.capture.identity import UsbDevice
from denseface.service.tools.doctor import machine, sensor
from denseface.service.tools.doctor.findings import (
    Finding,
    Level,
    as_json,
    as_lines,
    ok,
    problem,
    warning,
    worst,
)
from tests.waiting import LIMIT_S, until

XTION = UsbDevice("1-4.2", 0x1D27, 0x0601, 1, 17, speed_mbit=480)
KINECT = UsbDevice("2-1", 0x045E, 0x02AE, 2, 4, "A00367A01433047A", 480, ("gspca_kinect",))
MOUSE = UsbDevice("3-1", 0x046D, 0xC52B, 3, 2)


def of_level(findings, level=Level.PROBLEM):
    return [finding.text for finding in findings if finding.level is level]


@pytest.fixture
def root(tmp_path):
    """A machine with udev and files of both devices."""
    for name in ("run/udev/control", "dev/bus/usb/001/017", "dev/bus/usb/002/004"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


@pytest.fixture
def library(tmp_path, monkeypatch):
    """An OpenNI2 with some drivers."""
    folder = tmp_path / "openni" / "OpenNI2" / "Drivers"
    folder.mkdir(parents=True)
    (folder.parents[1] / "libOpenNI2.so").touch()
    for name in ("libPS1080.so.0", "libPS1080.so", "libOniFile.so.0"):
        (folder / name).touch()
    monkeypatch.setenv("OPENNI2_REDIST64", str(folder.parents[1]))
    return folder


def test_the_python_is_named_and_one_that_was_not_tried_is_a_warning(monkeypatch):
    found = machine.look_at_python()
    assert (found.level, found.text) == ("ok", f"{platform.python_version()}, {sys.executable}")
    monkeypatch.setattr(machine, "untried_python", lambda: "Python 3.15.0 is newer")
    assert machine.look_at_python() == warning(
        "Python", "Python 3.15.0 is newer", "install denseface with one of those")


def test_the_drivers_that_are_there(library):
    (finding,) = machine.look_at_library([XTION, MOUSE])
    assert finding.level is Level.OK
    assert finding.text.startswith(f"OniFile, PS1080 in {library}; no Freenect")
    (library / "libFreenectDriver.so.0").touch()
    (finding,) = machine.look_at_library([XTION, MOUSE])
    assert finding.text == f"FreenectDriver, OniFile, PS1080 in {library}"


def test_a_kinect_without_its_driver(library):
    _, finding = machine.look_at_library([KINECT])
    assert finding.text == "no Freenect driver for the Kinect v1 at USB 2-1"
    assert f"{library}/libFreenectDriver.so.0" in finding.remedy
    (library / "libFreenectDriver.so.0").touch()
    (finding,) = machine.look_at_library([KINECT])
    assert finding.level is Level.OK


def test_no_drivers_and_no_library(library, monkeypatch):
    for path in library.iterdir():
        path.unlink()
    assert of_level(machine.look_at_library([])) == [f"none in {library}"]
    monkeypatch.setenv("OPENNI2_REDIST64", "/nowhere")
    (finding,) = machine.look_at_library([])
    assert finding == problem("OpenNI2", "OPENNI2_REDIST64=/nowhere: no libOpenNI2.so in that "
                              "folder", "apt install libopenni2-dev")


def test_a_sensor_that_is_well_connected(root):
    assert [*machine.look_at_usb([XTION, MOUSE], root)] == [
        ok("USB 1-4.2", "Xtion, 1d27:0601, 480 Mbit/s")]


def test_no_sensor(root):
    (finding,) = machine.look_at_usb([MOUSE], root)
    assert finding.text == "Linux sees no depth sensor"


def test_a_slow_port(root):
    slow = UsbDevice("1-4.2", 0x1D27, 0x0601, 1, 17, speed_mbit=12)
    assert of_level(machine.look_at_usb([slow], root)) == [
        "Xtion, 1d27:0601, 12 Mbit/s: too slow for depth and color"]


def test_two_sensors_on_one_bus(root):
    other = UsbDevice("2-2", 0x1D27, 0x0601, 2, 4, speed_mbit=480)
    findings = [*machine.look_at_usb([KINECT, other], root)]
    assert of_level(findings, Level.WARNING)[0].endswith("and 1 more sensor on its bus")


def test_the_kernel_holds_a_kinect(root):
    finding = [*machine.look_at_usb([KINECT], root)][-1]
    assert finding.text == "the kernel's gspca_kinect holds its camera"
    assert "modprobe -r gspca_kinect" in finding.remedy


def test_a_device_that_may_not_be_opened(root, monkeypatch):
    (root / "dev/bus/usb/001/017").chmod(0o400)
    monkeypatch.setattr(machine.os, "access", lambda *_: False)
    finding = [*machine.look_at_usb([XTION], root)][-1]
    assert finding.text == "/dev/bus/usb/001/017 may not be opened by this user"
    assert 'ATTR{idVendor}=="1d27"' in finding.remedy


def test_a_container_without_devices_and_udev(tmp_path):
    findings = [*machine.look_at_usb([XTION], tmp_path)]
    assert of_level(findings) == ["/dev/bus/usb/001/017 is not there"]
    assert "does not run here" in of_level(findings, Level.WARNING)[0]


def answering(*steps):
    return dict(steps)


def listing(*sensors):
    return answering(("loading", {}), ("library", {"version": "2.2.0.33"}),
                     ("sensors", {"sensors": [dict(zip(("uri", "usb_port", "serial"), s,
                                                       strict=True)) for s in sensors]}))


def test_a_sensor_that_openni2_does_not_list():
    findings = [*sensor.look_at_list(listing(("1d27/0601@1/17", "1-4.2", "")), [XTION, KINECT])]
    assert [finding.text for finding in findings] == [
        "version 2.2.0.33", "1d27/0601@1/17 (USB port 1-4.2) is listed",
        "OpenNI2 does not list the Kinect v1 at USB 2-1"]
    # Two Kinects, whose URIs do not say which is which.
    both = listing(("freenect://0", "", ""), ("freenect://1", "", ""))
    assert of_level(sensor.look_at_list(both, [KINECT, KINECT])) == []
    assert of_level(sensor.look_at_list(listing(), [])) == ["OpenNI2 lists none"]


FRAME = {"skew_ms": 11.7, "skew_known_by": "stamps", "coverage": 0.8, "registered": False,
         "calibration": "device: ZPD 120", "brightness": 120.0, "notes": []}
OPEN = {"name": "S1", "uri": "1d27/0601@1/17",
        "offered": {"depth": 3, "color": 6},
        "chosen": {"depth": "640x480 at 30/s as DEPTH_1_MM", "color": "640x480 at 30/s as RGB888"}}


def frame(**changed):
    return answering(("opening", {}), ("open", OPEN), ("frame", FRAME | changed), ("closing", {}),
                     ("closed", {}))


def test_a_sensor_in_good_health():
    findings = [*sensor.look_at_frame("S1", frame(), [])]
    assert {finding.level for finding in findings} == {Level.OK}
    assert [finding.text for finding in findings] == [
        "1d27/0601@1/17, depth 640x480 at 30/s as DEPTH_1_MM (of 3), color 640x480 at 30/s as "
        "RGB888 (of 6)", "depth in 80% of the image, not registered",
        "depth and color 11.7 ms apart, by stamps", "calibration: device: ZPD 120"]


@pytest.mark.parametrize(("changed", "level", "text"), [
    ({"coverage": 0.02}, Level.PROBLEM, "depth in 2% of the image, not registered"),
    ({"skew_ms": -30.0}, Level.WARNING, "depth and color 30.0 ms apart, by stamps"),
    ({"brightness": 8.0}, Level.WARNING, "the color image is dark (8 of 255)"),
    ({"notes": ["mirrored"]}, Level.WARNING, "mirrored"),
])
def test_what_could_be_better(changed, level, text):
    assert of_level(sensor.look_at_frame("S1", frame(**changed), []), level) == [text]


def test_a_sensor_without_color():
    answers = frame(skew_ms=None, brightness=None)
    answers["open"] = OPEN | {"chosen": {"depth": OPEN["chosen"]["depth"]}}
    texts = [finding.text for finding in sensor.look_at_frame("S1", answers, [])]
    assert texts[0].endswith(", no color camera")
    assert not any("apart" in text for text in texts)


def test_a_sensor_that_the_service_has():
    answers = answering(("opening", {}), ("error", {"text": "cannot be opened: busy"}))
    (finding,) = sensor.look_at_frame("S1", answers, ["capture: streaming"])
    assert finding.level is Level.WARNING
    assert "capture: streaming" in finding.remedy
    (finding,) = sensor.look_at_frame("S1", answers, [])
    assert (finding.level, finding.text) == (Level.PROBLEM, "cannot be opened: busy")


@pytest.mark.parametrize(("script", "text"), [
    ("echo '{\"step\": \"opening\"}'; touch $0.hangs; exec sleep 600",
     "hangs while it is opened (given up after 1 s)"),
    ("echo '{\"step\": \"opening\"}'; kill -ABRT $$", "crashes while it is opened: SIGABRT"),
    ("echo noise of a driver; echo '{\"step\": \"closing\"}'; echo ValueError: no >&2; exit 1",
     "crashes while it is closed: ValueError: no"),
    ("exit 3", "crashes while OpenNI2 and its drivers are loaded: status 3"),
])
def test_a_driver_that_hangs_or_crashes(script, text, monkeypatch, tmp_path):
    interpreter = tmp_path / "python"
    interpreter.write_text(f"#!/bin/sh\n{script}\n")
    interpreter.chmod(0o700)
    monkeypatch.setattr(sensor.sys, "executable", str(interpreter))
    hangs = "sleep" in script

    class Watched(subprocess.Popen):
        def communicate(self, *given, **named):
            until(lambda: not hangs or Path(f"{interpreter}.hangs").exists())
            return super().communicate(*given, **named)

    monkeypatch.setattr(sensor.subprocess, "Popen", Watched)
    limit_s = 1.0 if hangs else LIMIT_S
    assert of_level(sensor.look_at_frame("S1", sensor.ask("uri", limit_s), [])) == [text]


def test_one_that_crashes_when_all_was_answered_is_a_warning():
    answers = frame() | {"crashed": {"where": "closed", "how": "SIGSEGV"}}
    findings = [*sensor.look_at_frame("S1", answers, [])]
    assert of_level(findings) == []
    assert of_level(findings, Level.WARNING) == ["crashes when the program ends: SIGSEGV"]


def test_findings_as_lines_and_json():
    findings = [ok("a", "fine"), warning("b", "so so", "do this")]
    assert as_lines(findings) == ["ok       a: fine", "warning  b: so so", "         -> do this"]
    assert json.loads(as_json(findings)) == {"level": "warning", "findings": [
        {"level": "ok", "what": "a", "text": "fine", "remedy": ""},
        {"level": "warning", "what": "b", "text": "so so", "remedy": "do this"}]}
    assert worst([]) is Level.OK
    assert worst([*findings, Finding(Level.PROBLEM, "c", "bad")]) is Level.PROBLEM
