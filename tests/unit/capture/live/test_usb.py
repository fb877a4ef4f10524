"""A sensor that was plugged in, and that the driver does not list."""

from denseface.capture.identity import UsbDevice
from denseface.capture.live.usb import UsbWatch


def xtion(number, port="1-4"):
    return UsbDevice(port, 0x1D27, 0x0601, 1, number)


MOUSE = UsbDevice("1-2", 0x046D, 0xC077, 1, 3)


def test_one_that_is_not_listed_within_a_second_is_named():
    watch = UsbWatch([])
    assert watch.unlisted([xtion(7)], [], 10.0) == ""
    assert watch.unlisted([xtion(7)], [], 10.9) == ""
    assert watch.unlisted([xtion(7)], [], 11.1) == "Xtion 1d27:0601 at port 1-4"


def test_one_that_was_there_from_the_start_is_as_well_known_as_it_will_be():
    watch = UsbWatch([xtion(7)])
    for now_s in (10.0, 20.0):
        assert watch.unlisted([xtion(7)], [], now_s) == ""


def test_a_replug_makes_it_another():
    watch = UsbWatch([xtion(7)])
    watch.unlisted([], [], 10.0)
    watch.unlisted([xtion(8)], [], 11.0)
    assert watch.unlisted([xtion(8)], [], 12.5)


def test_one_that_is_listed_in_time_is_none():
    watch = UsbWatch([])
    watch.unlisted([xtion(7)], [], 10.0)
    assert watch.unlisted([xtion(7)], ["1d27/0601@1/7"], 12.0) == ""
    assert watch.unlisted([xtion(7)], [], 14.0) == ""


def test_other_devices_and_other_sensors_are_none():
    watch = UsbWatch([])
    other = xtion(9, "1-5")
    for now_s in (10.0, 12.0):
        assert watch.unlisted([MOUSE, other], ["1d27/0601@1/9"], now_s) == ""
