"""Recordings through the real OpenNI2 library: made by its recorder, played by its player."""

import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest

from denseface.capture.oni.file import read_oni
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control, Format, Mode
from tests.virtual_sensor.process import RECORD, environment, play, record_clip, run_python

_JPEG_LOSS = 3.0
_OPEN = "import sys; from denseface.capture import open_source\nlist(open_source(sys.argv[1]))"


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(7)
    v, u = np.mgrid[:480, :640]
    return [(rng.integers(0, 9000, (480, 640), np.uint16),
             np.stack([u % 256, v % 256, (u + v + 20 * i) % 256], axis=-1).astype(np.uint8))
            for i in range(4)]


@pytest.fixture(scope="module")
def recorded(shown, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    write_clip(folder / "clip", shown, zpd_mm=121, zpps_mm=0.1052, dcrcdis_cm=2.5)
    record_clip(folder / "clip", folder / "take.oni", len(shown))
    return folder / "take.oni"


def test_what_is_recorded_is_played(recorded, shown):
    frames, origin = play(recorded)
    assert len(frames) == len(shown)
    for frame, (depth, color) in zip(frames, shown, strict=True):
        np.testing.assert_array_equal(frame.depth, depth)
        assert np.abs(frame.rgb.astype(int) - color).mean() < _JPEG_LOSS
        assert frame.skew_us == 0
        assert not frame.registered
    assert frames[0].calibration.depth.fx == pytest.approx(121 / 0.1052 / 2)
    assert frames[0].calibration.depth_to_color.translation_mm == pytest.approx((-25, 0, 0))
    assert origin == "recording: ZPD 121, ZPPS 0.1052, DCRCDIS 2.5, color field of view 62.7 deg"
    assert [path.name for path in recorded.parent.iterdir() if path.name.startswith(".")] == []


def test_the_file_ends_where_its_records_do(recorded):
    assert read_oni(recorded).end == recorded.stat().st_size


@pytest.mark.parametrize("pixel_format", [Format.YUV422, Format.YUYV])
def test_colour_that_was_recorded_in_another_format_is_read(shown, tmp_path, pixel_format):
    """As OpenNI2's tools record it: in the mode in which the sensor starts."""
    write_clip(tmp_path / "clip", shown)
    oni = tmp_path / "take.oni"
    with Control(tmp_path / "control", tmp_path / "clip") as control:
        control.color.offer(Mode(format=pixel_format))
        done = run_python(RECORD, oni, 4, env=environment(controls=[control]))
    assert done.returncode == 0, done.stderr
    frames, _ = play(oni)
    assert len(frames) >= 4
    for frame in frames:
        number = next(i for i, (depth, _) in enumerate(shown)
                      if (depth == frame.depth).mean() > 0.999)
        # Its colours are halved along the rows.
        assert np.abs(frame.color.astype(int) - shown[number][1]).mean() < 3 * _JPEG_LOSS


def test_a_file_beside_a_recording_says_that_its_depth_is_registered(recorded, tmp_path):
    path = tmp_path / "take.oni"
    path.write_bytes(recorded.read_bytes())
    (frame, *_), _ = play(path)
    beside = json.loads(frame.calibration.to_json()) | {"registered": True}
    path.with_name("take.calibration.json").write_text(json.dumps(beside))
    (said, *_), origin = play(path)
    assert (frame.registered, said.registered) == (False, True)
    assert origin == "beside: take.calibration.json"


def test_a_mirrored_recording_is_turned_back(shown, tmp_path):
    """Sensors start mirrored; a recorder that leaves it so stores mirrored frames."""
    write_clip(tmp_path / "clip", shown)
    code = """
import sys
from pathlib import Path
from tests.virtual_sensor.recorder import record
record(Path(sys.argv[1]), int(sys.argv[2]), mirrored=True)
"""
    oni = tmp_path / "mirrored.oni"
    record_clip(tmp_path / "clip", oni, len(shown), code=code)
    assert all(node.properties["xnMirror"] == 1 for node in read_oni(oni).nodes.values())
    for frame, (depth, color) in zip(play(oni)[0], shown, strict=True):
        np.testing.assert_array_equal(frame.depth, depth)
        assert np.abs(frame.rgb.astype(int) - color).mean() < _JPEG_LOSS


def test_a_recorder_that_gets_too_few_frames_leaves_no_file(shown, tmp_path):
    write_clip(tmp_path / "clip", shown)
    with pytest.raises(RuntimeError, match=r"SensorTimeoutError: .*after [34] of 5 frames"):
        record_clip(tmp_path / "clip", tmp_path / "short.oni", 5, attempts=1)
    assert [path.name for path in tmp_path.iterdir()] == ["clip"]


def test_each_pass_starts_at_the_first_frame(recorded):
    code = """
import sys
from itertools import islice
from denseface.capture import open_source
with open_source(sys.argv[1]) as source:
    for most in (2, 9, 0, 9):
        print(source.frame_count, [f.depth_timestamp_us for f in islice(source, most)])
"""
    done = run_python(code, recorded, env=environment())
    assert done.stderr == ""
    stamps = [0, 33333, 66666, 99999]
    assert done.stdout.splitlines() == [f"4 {stamps[:k]}" for k in (2, 4, 0, 4)]


def test_many_openings_in_one_process(recorded):
    """OpenNI2's player crashes where streams are destroyed while its thread is awake."""
    code = """
import sys
from denseface.capture import open_source
for _ in range(25):
    with open_source(sys.argv[1]) as source:
        assert len(list(source)) == 4
print("done")
"""
    done = run_python(code, recorded, env=environment())
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


def test_one_file_opened_twice_at_once(recorded):
    code = """
import sys
from denseface.capture import open_source
first, second = open_source(sys.argv[1]), open_source(sys.argv[1])
print([f.depth_timestamp_us == g.depth_timestamp_us for f, g in zip(first, second, strict=True)])
"""
    done = run_python(code, recorded, env=environment())
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{[True] * 4}\n", "")


@pytest.mark.parametrize("how", [
    "for _ in range(10): list(open_source(sys.argv[1]))",
    "for _ in range(10): next(iter(open_source(sys.argv[1])))",
    "source = open_source(sys.argv[1]); list(source)",
    "source = open_source(sys.argv[1]); next(iter(source)); sys.exit()",
    "for _ in range(5): source = open_source(sys.argv[1]); source.me = source; list(source)",
])
def test_sources_that_nobody_closes(recorded, how):
    done = run_python(f"import sys\nfrom denseface.capture import open_source\n{how}", recorded,
                      env=environment())
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", ["ä ö.oni", "d" * 130 + "/" + "e" * 130 + ".oni"])
def test_names_that_openni2_does_not_survive(recorded, tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(recorded.read_bytes())
    assert len(play(path, max_frames=1)[0]) == 1


@pytest.mark.parametrize("closed", [True, False])
def test_with_debians_own_drivers(recorded, closed):
    """Also where the caller forgets to close: no crash at the end of the process."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OPENNI2", "VIRTUAL"))}
    code = ("import sys; from denseface.capture import open_source\n"
            "source = open_source(sys.argv[1])\n"
            "print(len(list(source)))\n" + ("source.close()" if closed else ""))
    done = run_python(code, recorded, env=env)
    assert (done.returncode, done.stdout, done.stderr) == (0, "4\n", "")


def damaged(whole: bytes, how: str) -> bytes:
    return {
        "empty": b"",
        "text": b"not a recording at all " * 50,
        "random": np.random.default_rng(0).bytes(100_000),
        "magic_and_garbage": b"NI10" + np.random.default_rng(0).bytes(100_000),
        "header_only": whole[:24],
        "before the first frame": whole[:1000],
        "size_changed": whole[:36] + b"\xff\xff\xff\x7f" + whole[40:],
    }[how]


@pytest.mark.parametrize("how", ["empty", "text", "random", "magic_and_garbage", "header_only",
                                 "before the first frame", "size_changed"])
def test_damaged_files_end_cleanly(recorded, tmp_path, how):
    path = tmp_path / "bad.oni"
    path.write_bytes(damaged(recorded.read_bytes(), how))
    done = run_python(_OPEN, path, env=environment())
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        f"denseface.capture.errors.UnreadableSourceError: {path}: ")


@pytest.mark.parametrize(("name", "becomes"), [
    (b"xnMirror", b"xnM\xffrror"), (b"Cropping", b"Cr\xe4pping"), (b"xnMapOutputMode", b"x" * 15),
    (b"oniPixelFormat", b"oniPixelFormaZ"), (b"oniRequiredFrameSize", b"q" * 20),
])
def test_damaged_properties_end_cleanly(recorded, tmp_path, name, becomes):
    """The records are whole and their names are not: frames or a named error, no crash."""
    path = tmp_path / "bad.oni"
    path.write_bytes(recorded.read_bytes().replace(name, becomes))
    done = run_python(_OPEN, path, env=environment())
    assert done.returncode in (0, 1), done.stderr
    if done.returncode:
        assert "denseface.capture.errors.UnreadableSourceError" in done.stderr


@pytest.mark.parametrize("sides", [None, (0, 480), (640, 2**31)])
def test_a_stream_without_a_size_is_named_before_openni2_sees_it(recorded, tmp_path, sides):
    path = tmp_path / "bad.oni"
    mode = b"xnMapOutputMode\0" + struct.pack("<I", 12)
    whole = recorded.read_bytes()
    assert mode in whole
    if sides is None:
        changed = whole.replace(mode, b"x" * 15 + mode[15:])
    else:
        at = whole.index(mode) + len(mode)
        changed = whole[:at] + struct.pack("<II", *sides) + whole[at + 8:]
    path.write_bytes(changed)
    done = run_python(_OPEN, path, env=environment())
    found = "no size" if sides is None else "{}x{}".format(*sides)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"denseface.capture.errors.UnreadableSourceError: {path}: the depth stream has {found}, "
        "expected sides of 1 to 16384")


@pytest.fixture(scope="module")
def kinect():
    folder = Path(os.environ.get("DENSEFACE_SHARED")
                  or Path(__file__).resolve().parents[3] / "shared")
    path = folder / "recordings" / "kinect_v1_room_no_face.oni"
    if not path.is_file():
        pytest.skip(f"no real recording at hand ({path.name} in the folder `shared`)")
    return path


def test_a_real_kinect(kinect):
    frames, origin = play(kinect)
    assert len(frames) == 12
    assert all(11_600 <= frame.skew_us <= 12_100 for frame in frames)
    assert origin == "recording: ZPD 120, ZPPS 0.1042, DCRCDIS 2.3"
    assert frames[0].calibration.depth.fx == pytest.approx(575.8, abs=0.05)
    # It was recorded in the colour camera's pixels, and mirrored.
    assert frames[0].registered
    # Turned back, the projector's wide shadows lie to the left of what casts them: the projector
    # is to the right of the depth camera. The narrow gaps to the right are what the colour camera
    # sees and the depth camera does not: the colour camera is to the right as well.
    left, right = gaps(frames[0].depth, 12, 40)
    assert left > 10 * right
    left, right = gaps(frames[0].depth, 2, 5)
    assert right > 2 * left


def gaps(depth, least: int, most: int) -> tuple[int, int]:
    """Count gaps of that many pixels to the left and to the right of something nearer."""
    left = right = 0
    for row in depth[60:470].astype(int):
        seen = np.flatnonzero(row)
        width = np.diff(seen) - 1
        at = np.flatnonzero((width >= least) & (width <= most))
        before, after = row[seen[at]], row[seen[at + 1]]
        left += np.count_nonzero(before > 1.15 * after)
        right += np.count_nonzero(after > 1.15 * before)
    return left, right
