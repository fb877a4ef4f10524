"""A source reconstructed frame after frame, and its figures."""

import itertools
from collections import deque

import numpy as np
import pytest

from denseface.capture.errors import SensorTimeoutError, UnreadableSourceError
from denseface.recon import Face, NoDepthError, NoFaceError, Settings
from denseface.service.tools import live as module
from denseface.service.tools.live import LiveFrame, Tally, live
from tests.unit.frames import frame
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


class Clock:
    """Each look at it takes so many seconds."""

    def __init__(self, step=1.0):
        self.now, self.step = 0.0, step

    def __call__(self):
        self.now += self.step
        return self.now


def failed(error=None, **times):
    return LiveFrame(EMPTY, error or NoFaceError("no face"), times)


def succeeded(face=None, **times):
    return LiveFrame(EMPTY, face or small_face(), times)


def test_a_recording_begins_again_and_no_face_is_an_outcome():
    source = Recording(EMPTY, ROOM)
    done = list(itertools.islice(live(source, Settings()), 5))
    assert [type(one.outcome) for one in done] == [
        NoDepthError, NoFaceError, NoDepthError, NoFaceError, NoDepthError]
    assert [one.frame for one in done] == [EMPTY, ROOM, EMPTY, ROOM, EMPTY]
    assert source.passes == 3


def test_a_failure_has_the_times_of_the_wait_and_of_the_attempt():
    (done,) = itertools.islice(live(Recording(EMPTY), Settings(), Clock()), 1)
    assert done.timings_ms == {"capture": 1000, "without_face": 1000}


def test_a_face_has_the_times_of_its_stages(monkeypatch):
    face = small_face()
    monkeypatch.setattr(module, "reconstruct", lambda *_: face)
    (done,) = itertools.islice(live(Recording(small_frame()), Settings(), Clock()), 1)
    assert done.outcome is face
    assert list(done.timings_ms) == ["capture", *face.report.timings_ms]


def test_all_is_warm_before_the_first_frame_is_asked_for(monkeypatch):
    source = Recording(EMPTY)
    passes = []
    monkeypatch.setattr(module, "warm", lambda: passes.append(source.passes))
    next(live(source, Settings()))
    assert passes == [0]


def test_a_source_without_a_frame_is_named():
    with pytest.raises(UnreadableSourceError, match="made up: holds no pair"):
        next(live(Recording(), Settings()))


def test_a_sensor_that_goes_away_is_not_hidden():
    frames = live(Recording(EMPTY, then=SensorTimeoutError("gone")), Settings())
    next(frames)
    with pytest.raises(SensorTimeoutError, match="gone"):
        next(frames)


def test_a_fault_of_our_own_is_not_hidden(monkeypatch):
    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(module, "reconstruct", broken)
    with pytest.raises(ZeroDivisionError):
        next(live(Recording(EMPTY), Settings()))


def test_a_tally_counts_faces_and_named_failures():
    tally = Tally(Clock(0.5))
    for done in (succeeded(), failed(), succeeded(), failed(NoDepthError("none")), failed()):
        tally.add(done)
    assert (tally.frames, tally.faces) == (5, 2)
    assert tally.failures == {"NoFaceError": 2, "NoDepthError": 1}
    assert tally.seconds == 2.5
    assert tally.rate == tally.recent_rate == 2
    face = small_face()
    assert tally.points() == (len(face.initial), len(face.dense))


def test_a_tally_of_nothing_has_no_figures():
    tally = Tally(Clock())
    assert (tally.frames, tally.faces, tally.seconds, tally.rate, tally.recent_rate) == (
        0, 0, 0, 0, 0)
    assert tally.points() is None
    assert tally.stages_ms() == {}


def test_the_recent_rate_forgets_what_is_long_past():
    clock = Clock(10)
    tally = Tally(clock)
    for _ in range(5):
        tally.add(failed())
    clock.step = 0.1
    for _ in range(40):
        tally.add(failed())
    assert tally.recent_rate == pytest.approx(10)
    assert tally.rate < 1


def test_stage_times_are_medians_and_high_percentiles():
    tally = Tally(Clock())
    for ms in range(101):
        tally.add(succeeded(capture=1.0, rbf=float(ms)))
    tally.add(failed(capture=1.0, without_face=7.0))
    assert tally.stages_ms() == {
        "capture": (1, 1), "rbf": (50, 99), "without_face": (7, 7)}


def test_a_run_for_days_keeps_only_the_newest_times(monkeypatch):
    monkeypatch.setattr(module, "_KEPT", 3)
    tally = Tally(Clock())
    deque((tally.add(succeeded(rbf=float(ms))) for ms in range(10)), 0)
    assert tally.stages_ms()["rbf"][0] == 8
    assert tally.frames == 10


def test_an_outcome_is_a_face_or_says_why_not():
    assert isinstance(succeeded().outcome, Face)
    assert str(failed(NoFaceError("nobody")).outcome) == "nobody"
