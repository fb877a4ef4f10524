"""The command line as its users run it."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from denseface.service.export import load_face
from tests.ports import free_port
from tests.system.running import RECORDINGS, REPOSITORY, denseface, hub_alone
from tests.waiting import LIMIT_S, until

FRONTAL = RECORDINGS / "frontal_700.oni"
SHARED = Path(os.environ.get("DENSEFACE_SHARED", REPOSITORY.parent / "shared"))


def test_a_recording_becomes_a_face_a_report_and_a_picture(tmp_path):
    done = denseface(
        "reconstruct", FRONTAL, "--frame", 1, "-o", tmp_path / "face.npz", "--report",
        tmp_path / "report.json", "--preview", tmp_path / "face.png", "--preset", "faithful",
        "--set", "ratio=9")
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads((tmp_path / "report.json").read_text())
    face = load_face(tmp_path / "face.npz")
    assert (report["settings"]["preset"], report["settings"]["ratio"]) == ("faithful", 9)
    assert report["initial_points"] == len(face.initial)
    assert f"{len(face.dense):,} dense points" in done.stdout
    assert (tmp_path / "face.png").stat().st_size > 50_000


def test_three_frames_are_averaged(tmp_path):
    done = denseface("reconstruct", FRONTAL, "--frames", 3, "--report", tmp_path / "r.json")
    assert done.returncode == 0
    report = json.loads((tmp_path / "r.json").read_text())
    assert (report["fused"], report["depth_rounding"]) == (3, "none")


@pytest.mark.parametrize(("arguments", "message"), [
    ([FRONTAL, "--frame", "99"], "--frame asks for 99"),
    ([FRONTAL, "--frame", "1", "--frames", "3"], "--frames asks for 3"),
])
def test_wrong_input_is_one_line_and_status_2(arguments, message):
    done = denseface("reconstruct", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert message in line


@pytest.mark.parametrize("recording", [
    RECORDINGS / "empty_room.oni", SHARED / "recordings" / "kinect_v1_room_no_face.oni"],
    ids=lambda path: path.stem)
def test_a_room_without_a_face_is_one_line_and_status_1(recording, tmp_path):
    if not recording.exists():
        pytest.skip(f"{recording.name} is not there (DENSEFACE_SHARED names its folder)")
    done = denseface("reconstruct", recording, "-o", tmp_path / "face.ply")
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert "no face" in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", [["press"], ["subscribe"], ["status", "--wait", "50"]])
def test_ctrl_c_ends_a_waiting_command_quietly(command, tmp_path):
    address = f"ipc://{tmp_path}/none"[:90]
    waiting = subprocess.Popen(
        [sys.executable, "-m", "denseface", *command, "--address", address], cwd=REPOSITORY,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert b"waiting for the hub" in waiting.stderr.readline()  # not before it waits
    waiting.send_signal(signal.SIGINT)
    out, err = waiting.communicate(timeout=LIMIT_S)
    assert (out, err) == (b"", b"")
    # Where the signal came inside an exec(), CPython ends by the signal itself: 130 to a shell too.
    assert waiting.returncode in {130, -signal.SIGINT}


def test_the_log_is_json_when_asked_for(tmp_path):
    address = f"tcp://127.0.0.1:{free_port()}"
    with hub_alone(address, tmp_path / "data", "--log", "json") as log:
        until(lambda: "listening" in log.read_text())
    for line in log.read_text().splitlines():
        assert {"event", "level", "timestamp", "process"} <= json.loads(line).keys()
