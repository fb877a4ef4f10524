"""Recordings that were cut, lack something or began in disorder, through the real OpenNI2."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from denseface.capture.oni.file import read_oni
from denseface.capture.oni.records import HEADER
from tests.system.running import RECORDINGS, denseface
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.edited import began_late, edited, records_of, without_cropping
from tests.virtual_sensor.process import environment, record_clip, run_python
from tests.waiting import LIMIT_S, until

_FRAMES = 10
_PERIOD_US = 33_333
_NUMBERS = """
import json, sys
from denseface.capture import open_source
for name in sys.argv[1:]:
    print(json.dumps(name))
    with open_source(name) as source:
        for frame in source:
            # Both images hold the number of the frame that was shown.
            print(json.dumps({
                "depth": int(frame.depth[100, 100]) - 1000,
                "color": round(frame.color[8:40, 8:40, 2].mean() / 20),
                "skew_us": frame.skew_us, "skew_known_by": frame.origin.skew_known_by,
                "notes": frame.origin.notes, "count": source.frame_count}))
"""
_DEPTH, _COLOR = 1, 2


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("clip") / "clip"
    frames = []
    for number in range(_FRAMES):
        color = np.full((480, 640, 3), 100, np.uint8)
        color[..., 2] = 20 * number
        frames.append((np.full((480, 640), 1000 + number, np.uint16), color))
    write_clip(path, frames)
    return path


@pytest.fixture(scope="module")
def recorded(clip) -> bytes:
    path = clip.with_name("whole.oni")
    record_clip(clip, path, _FRAMES)
    return path.read_bytes()


def played(tmp_path: Path, *contents: bytes) -> list[list[dict]]:
    """Play files in a process of its own; give the frames of each."""
    paths = [tmp_path / f"take-{number}.oni" for number in range(len(contents))]
    for path, content in zip(paths, contents, strict=True):
        path.write_bytes(content)
    done = run_python(_NUMBERS, *paths, env=environment())
    assert (done.returncode, done.stderr) == (0, "")
    found: list[list[dict]] = []
    for line in map(json.loads, done.stdout.splitlines()):
        if isinstance(line, str):
            found.append([])
        else:
            found[-1].append(line)
    return found


def refusal(tmp_path: Path, content: bytes) -> str:
    path = tmp_path / "take.oni"
    path.write_bytes(content)
    done = run_python(_NUMBERS, path, env=environment())
    assert done.returncode == 1
    return done.stderr.splitlines()[-1].partition("UnreadableSourceError: ")[2]


def numbers(frames: list[dict]) -> list[tuple[int, int]]:
    return [(frame["depth"], frame["color"]) for frame in frames]


def test_a_whole_recording_has_no_notes(recorded, tmp_path):
    frames, = played(tmp_path, recorded)
    assert numbers(frames) == [(i, i) for i in range(_FRAMES)]
    for frame in frames:
        assert (frame["notes"], frame["skew_us"]) == ([], 0)
        assert (frame["skew_known_by"], frame["count"]) == ("record order", _FRAMES)


def test_color_that_began_late_is_paired_with_its_depth(recorded, tmp_path):
    lags = (1, 2, 3, 8)
    found = played(tmp_path, *(began_late(recorded, _COLOR, late) for late in lags))
    for late, frames in zip(lags, found, strict=True):
        assert numbers(frames) == [(i, i) for i in range(late, _FRAMES)]
        for frame in frames:
            assert frame["skew_known_by"] == "record order"
            assert abs(frame["skew_us"]) <= 1_000
            assert frame["count"] == _FRAMES - late
            assert frame["notes"] == [
                f"the recording's color stream began {late * _PERIOD_US / 1e3:.0f} ms after its "
                "depth stream, but the time stamps of both start together: depth and color are "
                "paired by the order of records, known to one frame"]


def test_depth_that_began_late_is_paired_with_its_color(recorded, tmp_path):
    frames, = played(tmp_path, began_late(recorded, _DEPTH, 3))
    # The order allows for one frame more or less.
    assert {color - depth for depth, color in numbers(frames)} <= {0, -1}
    assert all("depth stream began" in frame["notes"][0] for frame in frames)


def test_color_alone_and_then_depth_alone(recorded, tmp_path):
    def edit(record):
        number = int.from_bytes(record.fields[8:12], "little")
        keep = record.kind != 0x0A or (number <= 4) == (record.node == _COLOR)
        return (record,) if keep else ()

    assert "holds no pair of depth and color: 6 depth and 4 color frames" in refusal(
        tmp_path, edited(recorded, edit))


def test_a_recording_without_cropping_is_played(recorded, tmp_path):
    frames, = played(tmp_path, without_cropping(recorded))
    assert numbers(frames) == [(i, i) for i in range(_FRAMES)]
    assert frames[0]["notes"] == [
        "the recording lacks the Cropping property of the depth stream, the Cropping property of "
        "the color stream; a mended copy is played"]


def cuts(content: bytes) -> dict[str, tuple[int, int]]:
    """Give where to cut a file, and how many whole pairs are before."""
    at, frames = HEADER.size, []
    for record in records_of(content):
        at += len(bytes(record))
        if record.kind == 0x0A:
            frames.append((at, len(record.payload)))
    last, size = frames[-1]
    return {
        "in the end record": (len(content) - 1, _FRAMES),
        "before the end record": (len(content) - 28, _FRAMES),
        "in the table of frames": (last + 100, _FRAMES),
        "after the last frame": (last, _FRAMES),
        "in the last frame": (last - size // 2, _FRAMES - 1),
        "in the head of the last frame": (last - size - 20, _FRAMES - 1),
        "before the last frame": (last - size - 40, _FRAMES - 1),
        "in the middle": (frames[9][0] + 7, 5),
        "after the first pair": (frames[1][0], 1),
    }


def test_the_whole_frames_of_a_cut_recording_are_used(recorded, tmp_path):
    wanted = cuts(recorded)
    found = played(tmp_path, *(recorded[:at] for at, _ in wanted.values()))
    for frames, (where, (_, pairs)) in zip(found, wanted.items(), strict=True):
        assert numbers(frames) == [(i, i) for i in range(pairs)], where
        note = f"the {pairs} whole frames before that are used"
        assert note in frames[0]["notes"][0], where


def test_a_recording_cut_before_its_first_frame(recorded, tmp_path):
    first = next(at for at, record in positions(recorded) if record.kind == 0x0A)
    assert "without an end record" in refusal(tmp_path, recorded[:first])


def positions(content: bytes):
    at = HEADER.size
    for record in records_of(content):
        yield at, record
        at += len(bytes(record))


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_recording_of_openni2s_recorder_that_was_killed(clip, tmp_path, how):
    """Its header and tables are those of the start."""
    path = tmp_path / "killed.oni"
    code = ("import sys\nfrom pathlib import Path\nfrom tests.virtual_sensor.recorder import record"
            "\nrecord(Path(sys.argv[1]), 1000)")
    root = Path(__file__).resolve().parents[2]
    with subprocess.Popen([sys.executable, "-c", code, path],
                          env=environment(clip) | {"PYTHONPATH": str(root)}) as recorder:
        until(lambda: path.exists() and path.stat().st_size and _pairs(path) >= 5, LIMIT_S)
        recorder.send_signal(how)
    frames, = played(tmp_path, path.read_bytes())
    assert len(frames) >= 5
    assert all(a == b for a, b in numbers(frames))
    assert "whole frames before that are used" in frames[0]["notes"][0]


def _pairs(path: Path) -> int:
    try:
        return min(node.frames for node in read_oni(path).nodes.values())
    except OSError:
        return 0


def test_no_room_for_a_mended_copy(recorded, tmp_path):
    path = tmp_path / "take.oni"
    path.write_bytes(without_cropping(recorded))
    code = ("import shutil, sys\nfrom collections import namedtuple\n"
            "shutil.disk_usage = lambda _: namedtuple('Usage', 'free')(2**20)\n"
            "from denseface.capture import open_source\nopen_source(sys.argv[1])")
    done = run_python(code, path, env=environment())
    assert "a mended copy needs 0 MiB and 64 MiB to spare in" in done.stderr


def test_what_was_doubtful_about_a_recording_is_printed_and_reported(tmp_path):
    """Colour began two of three frames late, and the last record is cut."""
    path, report = tmp_path / "take.oni", tmp_path / "report.json"
    path.write_bytes(began_late((RECORDINGS / "frontal_700.oni").read_bytes(), _COLOR, 2)[:-9])
    done = denseface("reconstruct", path, "--report", report, "-o", tmp_path / "face.ply")
    assert done.returncode == 0, done.stderr
    said = json.loads(report.read_text())
    assert said["skew_known_by"] == "record order"
    for words in ("the 1 whole frames before that are used", "color stream began 67 ms after"):
        assert any(words in warning for warning in said["warnings"])
        assert words in done.stderr
