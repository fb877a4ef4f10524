"""The figures of a live run."""

from collections import deque
from dataclasses import replace

import pytest

from denseface.recon import Face, NoDepthError, NoFaceError
from denseface.service.tools import _live_statistics
from denseface.service.tools._live_statistics import LiveFrame, LiveStatistics
from tests.unit.service.clocks import SteppingClock
from tests.unit.service.faces import small_face, small_frame


def failed(error=None, **times):
    return LiveFrame(small_frame(), error or NoFaceError("no face"), times)


def succeeded(face=None, **times):
    return LiveFrame(small_frame(), face or small_face(), times)


def test_faces_and_named_failures_are_counted():
    statistics = LiveStatistics(SteppingClock(0.5))
    for done in (succeeded(), failed(), succeeded(), failed(NoDepthError("none")), failed()):
        statistics.add(done)
    assert (statistics.frames, statistics.faces) == (5, 2)
    assert statistics.failures == {"NoFaceError": 2, "NoDepthError": 1}
    assert statistics.seconds == 2.5
    assert statistics.rate == statistics.recent_rate == 2
    face = small_face()
    assert statistics.points() == (len(face.initial), len(face.dense))


def test_warnings_are_counted_whatever_their_numbers_are():
    statistics = LiveStatistics(SteppingClock(0.5))
    for number in range(3):
        face = small_face()
        report = face.report.model_copy(update={"warnings": (f"only {number}.5 seeds",)})
        statistics.add(succeeded(replace(face, report=report)))
    assert statistics.warnings == {"only N seeds": 3}


def test_without_a_frame_there_are_no_figures():
    statistics = LiveStatistics(SteppingClock())
    assert statistics.frames == statistics.faces == statistics.seconds == 0
    assert statistics.rate == statistics.recent_rate == 0
    assert statistics.points() is None
    assert statistics.stages_ms() == {}


def test_the_recent_rate_forgets_what_is_long_past():
    clock = SteppingClock(10)
    statistics = LiveStatistics(clock)
    for _ in range(5):
        statistics.add(failed())
    clock.step = 0.1
    for _ in range(40):
        statistics.add(failed())
    assert statistics.recent_rate == pytest.approx(10)
    assert statistics.rate < 1


def test_stage_times_are_medians_and_high_percentiles():
    statistics = LiveStatistics(SteppingClock())
    for ms in range(101):
        statistics.add(succeeded(capture=1.0, rbf=float(ms)))
    statistics.add(failed(capture=1.0, without_face=7.0))
    assert statistics.stages_ms() == {
        "capture": (1, 1), "rbf": (50, 99), "without_face": (7, 7)}


def test_a_run_for_days_keeps_only_the_newest_times(monkeypatch):
    monkeypatch.setattr(_live_statistics, "_MAX_TIMES", 3)
    statistics = LiveStatistics(SteppingClock())
    deque((statistics.add(succeeded(rbf=float(ms))) for ms in range(10)), 0)
    assert statistics.stages_ms()["rbf"][0] == 8
    assert statistics.frames == 10


def test_an_outcome_is_a_face_or_says_why_not():
    assert isinstance(succeeded().outcome, Face)
    assert str(failed(NoFaceError("nobody")).outcome) == "nobody"
