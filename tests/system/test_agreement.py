"""Depth and colour belong together: on every recording each fault is found, and none without."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from denseface.capture.agreement import Verdict, measure_agreement
from denseface.capture.npz import load_frame, save_frame
from denseface.capture.rotation import rotate_frame
from tests.faults import FAULTS, registered_depth
from tests.simulator import KINECT_DEFAULT, Person, Scene, shared_folder, simulate
from tests.system.running import RECORDINGS, run_here
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control, Honesty
from tests.virtual_sensor.fixtures import FIXTURES
from tests.virtual_sensor.process import environment, play, record_clip

TURNED = {"colour mirrored": (True, False), "depth mirrored": (False, True),
          "both mirrored": (True, True)}
"""Which image was mirrored: colour, depth."""


@cache
def frames_of(name):
    return play(RECORDINGS / f"{name}.oni")[0]


@pytest.mark.parametrize("name", FIXTURES)
def test_on_right_frames_nothing_is_found(name):
    for frame in frames_of(name):
        found = measure_agreement(frame)
        assert (found.verdict, found.note) == (Verdict.AGREES, ""), found.scores
        assert measure_agreement(registered_depth(frame)).verdict is Verdict.AGREES


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", FIXTURES)
def test_each_fault_is_found(name, fault):
    right = frames_of(name)[0]
    wrong = FAULTS[fault](right)
    found = measure_agreement(wrong)
    assert found.verdict in {Verdict.CORRECTED, Verdict.DOUBTFUL}, found.scores
    assert found.note
    if found.verdict is Verdict.CORRECTED:
        mended = found.correction.apply(wrong)
        assert mended.registered == (fault == "registered, not said")
        turned = found.correction.turn_color, found.correction.turn_depth
        assert turned == TURNED.get(fault, (False, False))
        assert measure_agreement(mended).verdict is Verdict.AGREES


@cache
def moved_by(x_mm):
    scene = Scene((Person("procedural", 750, offset_mm=(x_mm, 0)),), decor=41)
    return simulate(scene, KINECT_DEFAULT, seed=5)[0].frame


@pytest.mark.parametrize("moved_mm", [-40, 30])
def test_colour_of_another_moment_is_warned_of(moved_mm):
    then, now = moved_by(0), moved_by(moved_mm)
    assert measure_agreement(now).verdict is Verdict.AGREES
    found = measure_agreement(replace(then, color=now.color))
    assert found.verdict is Verdict.DOUBTFUL
    assert found.offset_px[0] == pytest.approx(525 * moved_mm / 750, abs=4)


def test_real_frames_agree():
    shared = shared_folder()
    recording = shared and shared / "recordings" / "kinect_v1_room_no_face.oni"
    if not recording or not recording.exists():
        pytest.skip("real recordings are not there (DENSEFACE_SHARED names their folder)")
    frames = play(recording)[0][::4]
    frames += [load_frame(path) for path in sorted((shared / "reports").glob("*.npz"))]
    for frame in frames:
        assert frame.registered
        assert measure_agreement(frame).verdict is Verdict.AGREES
    found = measure_agreement(replace(frames[0], registered=False))
    assert (found.verdict, found.correction.registered) == (Verdict.CORRECTED, True)


def test_a_recording_made_with_registration_on_is_put_right_and_said_to_be(tmp_path):
    right = frames_of("frontal_700")
    write_clip(tmp_path / "clip", [(registered_depth(frame).depth, frame.color)
                                   for frame in right])
    record_clip(tmp_path / "clip", tmp_path / "on.oni", len(right))
    done = run_here("reconstruct", tmp_path / "on.oni", "--report", tmp_path / "r.json")
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("warning: depth is in the colour camera's pixels already")
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["registered"] is True
    assert line.removeprefix("warning: ") in report["warnings"]
    good = run_here("reconstruct", RECORDINGS / "frontal_700.oni", "--report", tmp_path / "g.json")
    assert (good.returncode, good.stderr) == (0, "")
    spacing = json.loads((tmp_path / "g.json").read_text())["mean_spacing_mm"]
    assert report["mean_spacing_mm"] == pytest.approx(spacing * 575.8 / 525, rel=0.03)


@pytest.mark.parametrize("said", [True, False])
def test_what_the_user_says_of_registration_is_taken_and_measured(tmp_path, said):
    """The key `registered` in the file beside: right without a word, wrong put right with one."""
    right = frames_of("frontal_700")
    write_clip(tmp_path / "clip", [(registered_depth(frame).depth, frame.color)
                                   for frame in right])
    record_clip(tmp_path / "clip", tmp_path / "on.oni", len(right))
    beside = json.loads(right[0].calibration.to_json()) | {"registered": said}
    (tmp_path / "on.calibration.json").write_text(json.dumps(beside))
    done = run_here("reconstruct", tmp_path / "on.oni", "--report", tmp_path / "r.json")
    assert done.returncode == 0
    assert json.loads((tmp_path / "r.json").read_text())["registered"] is True
    assert len(done.stderr.splitlines()) == (0 if said else 1)


def test_a_sensor_that_mirrors_without_a_word_is_turned_back(tmp_path):
    right = frames_of("frontal_700")[0]
    write_clip(tmp_path / "clip", [(right.depth, right.color)] * 2)
    with Control(tmp_path / "sensor", tmp_path / "clip") as sensor:
        for stream in (sensor.depth, sensor.color):
            stream.mirroring = Honesty.MISSING
            stream.mirrored_at_start = True
        (seen, *_), _ = play("openni2:", environment(controls=[sensor]), max_frames=2)
    assert np.array_equal(seen.depth, right.depth)
    assert np.array_equal(seen.color, right.color)


def test_a_recording_on_its_side_is_turned(tmp_path):
    upright = frames_of("wall_close")[0]
    save_frame(rotate_frame(upright, 270), tmp_path / "lying.npz")
    done = run_here("reconstruct", tmp_path / "lying.npz")
    assert done.returncode == 1
    assert "--rotate 90" in done.stderr
    done = run_here("reconstruct", tmp_path / "lying.npz", "--rotate", 90)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split("points")[0] == run_here(
        "reconstruct", RECORDINGS / "wall_close.oni").stdout.split("points")[0]


def test_a_frame_that_fits_in_no_way_is_refused_by_name(tmp_path):
    room = frames_of("empty_room")[0]
    save_frame(replace(
        frames_of("two_people")[0], color=np.ascontiguousarray(room.color[::-1])),
        tmp_path / "odd.npz")
    done = run_here("reconstruct", tmp_path / "odd.npz")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "odd.npz: depth and colour do not belong together" in line
