"""How fast this machine is, in figures and in words."""

import json
from dataclasses import replace

import numpy as np
import pytest

from denseface import NoDepthError, Settings, save_frame
from denseface.recon.face import STAGES
from denseface.service.tools.bench import as_json, as_lines, measure_speed, sample_frame
from denseface.service.tools.bench.measuring import Speed, Times

FEW = Settings(ratio=1.0)
QUIET = Speed(
    "a frame, 640x480", "best", 15, (13_000, 130_000),
    {"detection": Times(5.0, 6.0, 9.0), "rbf": Times(8.0, 9.0, 11.0)},
    Times(20.0, 25.0, 31.25), Times(80.0, 99.0, 120.0), 2, busy=False)


@pytest.fixture(scope="module")
def speed():
    return measure_speed(None, None, FEW, 1)


def test_the_frame_that_comes_along_is_measured_stage_by_stage(speed):
    assert speed.frame == "a simulated frame, 640x480"
    assert list(speed.stages) == list(STAGES)
    for times in (*speed.stages.values(), speed.whole, speed.search):
        assert 0 <= times.least <= times.median <= times.slowest
    assert sum(times.least for times in speed.stages.values()) <= speed.whole.slowest
    assert speed.points[0] > 10_000
    assert speed.ratio == speed.whole.least / speed.search.least


def test_every_stage_is_told_in_words(speed):
    lines = list(as_lines(speed))
    for name in STAGES:
        row, = (line for line in lines if line.startswith(f"{name} "))
        assert len(row.split()) > 5
    assert all(len(line) <= 140 for line in lines)


def test_what_the_figures_mean_is_said():
    said = "\n".join(as_lines(QUIET))
    assert "takes 0.25 of the time of OpenCV's face search" in said
    assert "makes 40 faces a second here, more than the 30 frames" in said
    assert "busy" not in said
    slow = replace(QUIET, whole=Times(90.0, 100.0, 120.0), search=None, busy=True)
    said = "\n".join(as_lines(slow))
    assert "10 faces a second here, less than the 30" in said
    assert "OpenCV" not in said
    assert said.endswith("Other programs were busy meanwhile: on a quiet machine it is faster.")


def test_the_same_as_json():
    told = json.loads(as_json(QUIET))
    assert told["timings_ms"]["rbf"] == {"least": 8.0, "median": 9.0, "slowest": 11.0}
    assert (told["ratio"], told["faces_per_second"], told["cores"]) == (0.25, 40.0, 2)
    assert json.loads(as_json(replace(QUIET, search=None)))["ratio"] is None


def test_a_frame_of_ones_own_without_a_face_is_the_error_that_it_is(tmp_path):
    made = sample_frame()
    save_frame(replace(made, depth=np.zeros_like(made.depth)), tmp_path / "room.npz")
    with pytest.raises(NoDepthError):
        measure_speed(str(tmp_path / "room.npz"), None, FEW, 1)
