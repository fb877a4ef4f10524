"""When a colour camera has settled, and what of it can be locked."""

import ctypes

import numpy as np
import pytest

from denseface.capture.openni2._binding import OpenNIError
from denseface.capture.openni2._exposure import Exposure, Settling

WHITE_BALANCE, EXPOSURE = 100, 101


def image(level=(128.0, 128.0, 128.0)):
    return np.broadcast_to(np.round(level).astype(np.uint8), (48, 64, 3))


def frames_until_settled(levels):
    settling = Settling()
    return next(number for number, level in enumerate(levels, 1) if settling.settled(image(level)))


def test_a_steady_camera_has_settled_after_five_frames():
    assert frames_until_settled([(140, 120, 90)] * 9) == 5


@pytest.mark.parametrize("first", [(0.5, 0.36, 0.2), (1.4, 1.0, 1.0), (1.0, 1.0, 0.4)])
def test_a_camera_that_settles_over_30_frames(first):
    levels = [np.array((140, 120, 90)) * (np.array(first) + (1 - np.array(first)) * min(n / 25, 1))
              for n in range(60)]
    assert 27 <= frames_until_settled(levels) <= 30


def test_one_that_never_does_counts_as_settled_after_30():
    assert frames_until_settled([(100 + 40 * (n % 2),) * 3 for n in range(60)]) == 30


def test_in_the_dark():
    assert frames_until_settled([(0, 0, 0)] * 9) == 5


class Stream:
    """A colour stream with some of both properties; `stuck` are those that stay on."""

    def __init__(self, *numbers, stuck=()):
        self.values = dict.fromkeys(numbers, 1)
        self.stuck = stuck

    def get_property(self, number, kind):
        if number not in self.values:
            raise OpenNIError(5, b"not supported", "")
        return kind(self.values[number])

    def set_property(self, number, value):
        assert isinstance(value, ctypes.c_int)
        if number not in self.values:
            raise OpenNIError(5, b"not supported", "")
        if number not in self.stuck:
            self.values[number] = value.value


def test_locked_and_unlocked():
    stream = Stream(WHITE_BALANCE, EXPOSURE)
    exposure = Exposure(stream)
    assert exposure.missing == ()
    exposure.lock()
    assert stream.values == {WHITE_BALANCE: 0, EXPOSURE: 0}
    assert exposure.doubt == ""
    exposure.unlock()
    assert stream.values == {WHITE_BALANCE: 1, EXPOSURE: 1}


@pytest.mark.parametrize(("stream", "doubt"), [
    (Stream(), "the exposure and white balance of the color camera could not be locked"),
    (Stream(WHITE_BALANCE), "the exposure of the color camera could not be locked"),
    (Stream(WHITE_BALANCE, EXPOSURE, stuck=[EXPOSURE]),
     "the exposure of the color camera could not be locked"),
])
def test_what_cannot_be_locked_is_said(stream, doubt):
    exposure = Exposure(stream)
    exposure.lock()
    assert exposure.doubt == doubt


def test_freenects_property_of_the_exposure_is_left_alone():
    stream = Stream(WHITE_BALANCE, EXPOSURE)
    exposure = Exposure(stream, by_freenect=True)
    exposure.lock()
    assert stream.values == {WHITE_BALANCE: 0, EXPOSURE: 1}
    assert exposure.doubt == "the exposure of the color camera could not be locked"


def test_a_sensor_without_color():
    exposure = Exposure(None)
    assert exposure.settled(None)
    exposure.lock()
    exposure.unlock()
    assert exposure.doubt == ""
