"""A source reconstructed frame after frame."""

import itertools

import numpy as np
import pytest

from denseface.capture.errors import SensorTimeoutError, UnreadableSourceError
from denseface.recon import NoDepthError, NoFaceError, Settings
from denseface.service.tools import live
from denseface.service.tools.live import reconstruct_frames
from tests.unit.frames import frame
from tests.unit.service.clocks import SteppingClock
from tests.unit.service.faces import small_face, small_frame

GRAY = np.full((120, 160, 3), 90, np.uint8)
EMPTY = frame(np.zeros((120, 160), np.uint16), GRAY)
ROOM = frame(np.full((120, 160), 900, np.uint16), GRAY)


class Recording:
    """A source of made-up frames; each pass begins at the first."""

    def __init__(self, *frames, then=None):
        self.uri = "made up"
        self.frame_count = len(frames)
        self.passes = 0
        self._frames = frames
        self._then = then

    def __iter__(self):
        self.passes += 1
        yield from self._frames
        if self._then:
            raise self._then


def test_a_recording_begins_again_and_no_face_is_an_outcome():
    source = Recording(EMPTY, ROOM)
    done = list(itertools.islice(reconstruct_frames(source, Settings()), 5))
    assert [type(one.outcome) for one in done] == [
        NoDepthError, NoFaceError, NoDepthError, NoFaceError, NoDepthError]
    assert [one.frame for one in done] == [EMPTY, ROOM, EMPTY, ROOM, EMPTY]
    assert source.passes == 3


def test_a_failure_has_the_times_of_the_wait_and_of_the_attempt():
    (done,) = itertools.islice(reconstruct_frames(Recording(EMPTY), Settings(), SteppingClock()), 1)
    assert done.timings_ms == {"capture": 1000, "without_face": 1000}


def test_a_face_has_the_times_of_its_stages(monkeypatch):
    face = small_face()
    monkeypatch.setattr(live, "reconstruct", lambda *_: face)
    done = next(reconstruct_frames(Recording(small_frame()), Settings(), SteppingClock()))
    assert done.outcome is face
    assert list(done.timings_ms) == ["capture", *face.report.timings_ms]


def test_all_is_warm_before_the_first_frame_is_asked_for(monkeypatch):
    source = Recording(EMPTY)
    passes = []
    monkeypatch.setattr(live, "warm", lambda: passes.append(source.passes))
    next(reconstruct_frames(source, Settings()))
    assert passes == [0]


def test_a_source_without_a_frame_is_named():
    with pytest.raises(UnreadableSourceError, match="made up: holds no pair"):
        next(reconstruct_frames(Recording(), Settings()))


def test_a_sensor_that_goes_away_is_not_hidden():
    frames = reconstruct_frames(Recording(EMPTY, then=SensorTimeoutError("gone")), Settings())
    next(frames)
    with pytest.raises(SensorTimeoutError, match="gone"):
        next(frames)


def test_a_fault_of_our_own_is_not_hidden(monkeypatch):
    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(live, "reconstruct", broken)
    with pytest.raises(ZeroDivisionError):
        next(reconstruct_frames(Recording(EMPTY), Settings()))
