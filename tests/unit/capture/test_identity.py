"""Which sensor is which, on a Linux whose list of USB devices is made up."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import CalibrationError
from denseface.capture.identity import (
    Identity,
    UsbDevice,
    calibration_folder,
    distinct,
    file_name,
    find_calibration,
    identify,
    known_as,
    usb_devices,
)
from tests.unit.frames import calibration
from tests.unit.usb import plug

XTION = UsbDevice("1-4.2", 0x1D27, 0x0601, 1, 17, speed_mbit=480)
KINECT = UsbDevice("2-1", 0x045E, 0x02AE, 2, 4, "A00367A01433047A", 480, ("gspca_kinect",))


def test_the_devices_of_a_machine(tmp_path):
    plug(tmp_path, "1-4.2", "1d27", "0601", 1, 17)
    plug(tmp_path, "2-1", "045e", "02ae", 2, 4, serial="A00367A01433047A",
         drivers=["gspca_kinect"])
    plug(tmp_path, "3-1", "zzzz", "0000", 3, 1)
    (tmp_path / "usb1").mkdir()
    assert usb_devices(tmp_path) == [XTION, KINECT]
    assert (XTION.kind, KINECT.kind) == ("Xtion", "Kinect v1")
    assert UsbDevice("1-1", 0x2BC5, 0x0401, 1, 2).kind == "Orbbec sensor"
    assert UsbDevice("1-1", 0x046D, 0xC52B, 1, 2).kind is None
    assert str(XTION.node) == "/dev/bus/usb/001/017"
    assert str(XTION) == "1d27:0601 at port 1-4.2"


def test_a_machine_without_usb(tmp_path):
    assert usb_devices(tmp_path / "nothing") == []


@pytest.mark.parametrize(("uri", "serial", "expected"), [
    ("1d27/0601@1/17", None, Identity("1d27/0601@1/17", "1-4.2")),
    ("1d27/0601@1/17", "15081410", Identity("1d27/0601@1/17", "1-4.2", "15081410")),
    ("1d27/0601@1/18", None, Identity("1d27/0601@1/18")),
    ("freenect://0", None, Identity("freenect://0", "2-1", "A00367A01433047A")),
    ("freenect://0", "0000000000000000", Identity("freenect://0", "2-1", "A00367A01433047A")),
    ("virtual:0", "V1\0", Identity("virtual:0", serial="V1")),
    ("virtual:0", "PrimeSense", Identity("virtual:0")),
])
def test_what_is_known_of_a_sensor(uri, serial, expected):
    assert identify(uri, serial, [XTION, KINECT]) == expected


def test_of_two_kinects_the_uri_does_not_tell_which():
    other = UsbDevice("2-2", 0x045E, 0x02AE, 2, 5)
    assert identify("freenect://1", None, [KINECT, other]) == Identity("freenect://1")


def test_the_most_lasting_name():
    assert Identity("u", "1-2", "S1").name == "S1"
    assert Identity("u", "1-2").name == "1-2"
    assert Identity("u").name == "u"
    assert str(Identity("u", "1-2", "S1")) == "u (serial S1, USB port 1-2)"
    assert str(Identity("u")) == "u"


def test_two_sensors_with_one_serial_number():
    same = [Identity("a", "1-1", "S1"), Identity("b", "1-2", "S1"), Identity("c", "1-3", "S3")]
    assert [sensor.name for sensor in distinct(same)] == ["1-1", "1-2", "S3"]


THERE = [Identity("a@1/7", "1-1", "S1"), Identity("b@1/8", "1-2"), Identity("c@1/9")]


@pytest.mark.parametrize(("wanted", "found"), [
    ("S1", 0), ("1-1", 0), ("a@1/7", 0), ("1-2", 1), ("b@1/8", 1), ("c@1/9", 2),
    ("S9", None), ("", None),
    # After a replug, under other URIs.
    (Identity("a@1/4", "1-9", "S1"), 0), (Identity("b@1/4", "1-2"), 1),
    (Identity("c@1/9"), 2), (Identity("c@1/4"), None),
    # The number is said when the sensor is open only.
    (Identity("b@1/4", "1-2", "S2"), 1),
    # Another sensor in the same socket.
    (Identity("a@1/4", "1-1", "S2"), None),
])
def test_the_sensor_that_is_asked_for(wanted, found):
    assert known_as(wanted, THERE) == (None if found is None else THERE[found])


@given(st.text(max_size=300))
def test_any_name_gives_a_file_in_the_folder(name):
    made = file_name(name)
    assert "/" not in made
    assert not made.startswith(".") or made == ".calibration.json"
    assert len(made) < 255
    assert made.isascii()


def test_the_calibration_of_a_sensor(tmp_path):
    sensor = Identity("1d27/0601@1/17", "1-4.2", "S/1")
    assert find_calibration(sensor, tmp_path) is None
    for name, origin in (("1d27_0601_1_17", "by URI"), ("1-4.2", "by USB port"),
                         ("S_1", "by serial")):
        path = tmp_path / f"{name}.calibration.json"
        path.write_text(calibration().to_json())
        assert find_calibration(sensor, tmp_path) == ChosenCalibration(
            calibration(), f"{origin}: {name}.calibration.json")
    path.write_text("{}")
    with pytest.raises(CalibrationError, match=r"S_1\.calibration\.json: depth: Field required"):
        find_calibration(sensor, tmp_path)


def test_the_folder_of_calibrations(tmp_path, monkeypatch):
    monkeypatch.setenv("DENSEFACE_CALIBRATIONS", str(tmp_path))
    assert calibration_folder() == tmp_path
    monkeypatch.delenv("DENSEFACE_CALIBRATIONS")
    assert calibration_folder().parts[-2:] == ("denseface", "calibrations")
