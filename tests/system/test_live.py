"""`denseface live` as its users run it."""

import json
import os
import pty
import signal
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest

from tests.system.running import RECORDINGS, REPOSITORY, denseface
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.process import environment
from tests.waiting import LIMIT_S

FRONTAL = RECORDINGS / "frontal_700.oni"
EMPTY = RECORDINGS / "empty_room.oni"
STAGES = ["capture", "overview", "detection", "registration", "segmentation", "neighbors", "rbf",
          "judgement", "propagation", "total"]


def test_a_recording_goes_round_until_enough_frames_are_done():
    done = denseface("live", "--source", FRONTAL, "--frames", 8, "--preset", "faithful", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert (said["frames"], said["faces"], said["failures"]) == (8, 8, {})
    assert set(said["timings_ms"]) == set(STAGES)
    assert all(0 < one["median"] <= one["p99"] for one in said["timings_ms"].values())
    assert said["frames_per_second"] == pytest.approx(8 / said["seconds"], rel=0.01)
    assert said["dense_points"] > 8 * said["initial_points"]
    assert (said["settings"]["preset"], said["source"]) == ("faithful", str(FRONTAL))
    assert said["warm_ms"] > 0


def test_the_summary_is_a_table():
    done = denseface("live", "--source", FRONTAL, "--frames", 3)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].startswith("3 frames in ")
    assert lines[1].startswith("3 with a face, ")
    assert [line.split()[0] for line in lines[-len(STAGES):]] == STAGES


def test_frames_without_a_face_are_counted_by_name():
    done = denseface("live", "--source", EMPTY, "--frames", 3)
    assert (done.returncode, done.stderr) == (0, "")
    assert "0 with a face\n3 without: NoFaceError\n" in done.stdout


def test_seconds_end_it_too():
    done = denseface("live", "--source", FRONTAL, "--seconds", 0.2, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["seconds"] >= 0.2


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_a_signal_ends_it_with_the_summary(number, status):
    ours, theirs = pty.openpty()
    running = subprocess.Popen(
        [sys.executable, "-m", "denseface", "live", "--source", str(FRONTAL), "--json"],
        cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    shown = b""
    try:
        while b"points in" not in shown:  # the status line: it is under way
            shown += os.read(ours, 4096)
        running.send_signal(number)
        out, _ = running.communicate(timeout=LIMIT_S)
    finally:
        running.kill()
    os.close(ours)
    assert running.returncode == status
    assert json.loads(out)["frames"] >= 1
    assert b"Traceback" not in shown


def test_a_sensor_that_is_not_there_is_one_line():
    done = denseface("live", "--source", "missing.oni")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "missing.oni: no such file" in line


@pytest.fixture
def clip(tmp_path):
    frame = (np.full((480, 640), 900, np.uint16), np.full((480, 640, 3), 90, np.uint8))
    write_clip(tmp_path / "clip", [frame])
    return tmp_path / "clip"


def test_a_live_sensor(clip):
    done = denseface("live", "--frames", 3, "--json", **environment(clip))
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert (said["source"], said["frames"]) == ("openni2:", 3)


def test_a_sensor_that_goes_away_leaves_its_figures(clip, tmp_path):
    with Control(tmp_path / "control", clip) as control:
        ours, theirs = pty.openpty()
        running = subprocess.Popen(
            [sys.executable, "-m", "denseface", "live", "--json"], cwd=REPOSITORY, text=True,
            stdout=subprocess.PIPE, stderr=theirs, env=environment(controls=[control]))
        os.close(theirs)
        shown = b""
        try:
            while b" frames, " not in shown:  # before the first one, the line says how long
                shown += os.read(ours, 4096)
            control.unplug()
            with suppress(OSError):  # it has ended
                while more := os.read(ours, 4096):
                    shown += more
            out, _ = running.communicate(timeout=LIMIT_S)
        finally:
            running.kill()
        os.close(ours)
    assert running.returncode == 1
    assert json.loads(out)["frames"] >= 1
    assert shown.splitlines()[-1].rpartition(b"\x1b[K")[2].startswith(b"denseface live: ")
