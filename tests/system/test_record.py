"""`denseface record`, ended in every way: what was recorded can be played."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from denseface.capture.errors import CaptureError
from denseface.capture.oni.file import read_oni
from tests.system.running import RECORDINGS, REPOSITORY, denseface
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Call, Control, Format, Mode
from tests.virtual_sensor.process import environment, run_python
from tests.waiting import LIMIT_S, until

_MARKS = """
import json, sys
from denseface.capture import open_source
from tests.virtual_sensor.marks import read_mark
with open_source(sys.argv[1]) as source:
    for frame in source:
        print(json.dumps({
            "depth": read_mark(frame.depth, unit_um=frame.depth_meaning.unit_um).number,
            "color": frame.color is not None and read_mark(frame.color).number,
            "unit_um": frame.depth_meaning.unit_um,
            "skew_us": frame.skew_us, "skew_known_by": frame.origin.skew_known_by,
            "sensor": frame.origin.sensor, "captured_at": frame.origin.captured_at,
            "source": frame.origin.source,
            "rounding": frame.depth_meaning.rounding, "calibration": frame.calibration_origin,
            "notes": frame.origin.notes}))
"""
_LIMITED = """
import resource, sys
from denseface.service.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)), resource.RLIM_INFINITY))
sys.exit(main(sys.argv[1:]))
"""
"""A file that may not grow further: writing it fails as on a full disk."""
_FILLING = """
import shutil, sys
from collections import namedtuple
from denseface.service.cli import main
free = iter([10**12] * int(sys.argv.pop(1)))
shutil.disk_usage = lambda _: namedtuple("Usage", "free")(next(free, 200 << 20))
sys.exit(main(sys.argv[1:]))
"""
"""A disk that others fill after so many looks at it."""


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("clip") / "clip"
    rng = np.random.default_rng(5)
    write_clip(path, [(rng.integers(600, 1200, (480, 640), np.uint16),
                       rng.integers(0, 255, (480, 640, 3), np.uint8)) for _ in range(2)])
    return path


@pytest.fixture
def control(clip, tmp_path) -> Iterator[Control]:
    with Control(tmp_path / "control", clip, marks=True, serial="A00365") as control:
        yield control


@contextmanager
def recording(control: Control, out: Path, *arguments: object, code: str = ""
              ) -> Iterator["subprocess.Popen[str]"]:
    """Run `denseface record` on the virtual sensor."""
    program = ["-c", code] if code else ["-m", "denseface"]
    before = list(map(str, arguments)) if code else []
    after = [] if code else list(map(str, arguments))
    with subprocess.Popen(
            [sys.executable, *program, *before, "record", str(out), *after], cwd=REPOSITORY,
            env=environment(controls=[control]), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True) as process:
        try:
            yield process
        finally:
            control.hang = Call.NONE
            process.kill()


def pairs(out: Path) -> int:
    if out.is_dir():
        return len(list(out.glob("*.npz")))
    try:
        return min(node.frames for node in read_oni(out).nodes.values())
    except (CaptureError, ValueError):
        return 0


def wait_for(out: Path, count: int) -> None:
    until(lambda: pairs(out) >= count)


def played(out: Path) -> list[dict]:
    done = run_python(_MARKS, out, env=environment())
    assert (done.returncode, done.stderr) == (0, "")
    frames = [json.loads(line) for line in done.stdout.splitlines()]
    numbers = [frame["depth"] for frame in frames]
    assert [frame["color"] for frame in frames] == numbers, "each pair belongs together"
    assert numbers == sorted(set(numbers))
    return frames


def interrupt(control: Control, process: "subprocess.Popen[str]") -> None:
    process.send_signal(signal.SIGINT)


def terminate(control: Control, process: "subprocess.Popen[str]") -> None:
    process.terminate()


def kill(control: Control, process: "subprocess.Popen[str]") -> None:
    process.kill()


def unplug(control: Control, process: "subprocess.Popen[str]") -> None:
    control.unplug()


def silence(control: Control, process: "subprocess.Popen[str]") -> None:
    control.depth.silent = control.color.silent = True


def color_alone(control: Control, process: "subprocess.Popen[str]") -> None:
    control.depth.silent = True


def interrupt_and_hang(control: Control, process: "subprocess.Popen[str]") -> None:
    control.hang = Call.STOP | Call.CLOSE | Call.DESTROY_STREAM
    process.send_signal(signal.SIGINT)


ENDS: dict[str, tuple[Callable, int, str]] = {
    "Ctrl-C": (interrupt, 130, "stopped by Ctrl-C"),
    "SIGTERM": (terminate, 0, "stopped by SIGTERM"),
    "unplugged": (unplug, 1, "unplugged"),
    "silent": (silence, 1, "silent"),
    "color alone": (color_alone, 1, "the depth stream has fallen silent"),
    "Ctrl-C and a driver that hangs": (interrupt_and_hang, 130, "stopped by Ctrl-C"),
}


def without_progress(complaint, out):
    """The lines that are not about how far it is, of which there is one where it takes long."""
    progress = f"Ctrl-C ends it; recording {out}: "
    return [line for line in complaint.splitlines() if not line.startswith(progress)]


@pytest.mark.parametrize("how", ENDS)
def test_whatever_ends_a_recording_it_is_whole(control, tmp_path, how):
    end, status, words = ENDS[how]
    out = tmp_path / "take.oni"
    with recording(control, out) as process:
        wait_for(out, 6)
        end(control, process)
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert process.returncode == status, complaint
    assert said.count("\n") == 1
    assert without_progress(complaint, out) == []
    assert words in said
    found = read_oni(out)
    assert found.cut is None
    assert said.startswith(f"{out}: {pairs(out)} frames")
    frames = played(out)
    assert len(frames) == pairs(out) >= 6
    assert not any("recording" in note for frame in frames for note in frame["notes"])


@pytest.mark.parametrize("name", ["take.oni", "take"])
def test_a_recording_that_was_killed_is_played(control, tmp_path, name):
    out = tmp_path / name
    with recording(control, out) as process:
        wait_for(out, 6)
        process.kill()
    frames = played(out)
    assert len(frames) >= 6
    if not out.is_dir():
        assert any("whole frames before that are used" in note for note in frames[0]["notes"])


def test_a_recording_says_when_by_what_and_how(control, tmp_path):
    out = tmp_path / "take.oni"
    control.color.delay_us = 9_000
    before = datetime.now(UTC) - timedelta(seconds=1)
    with recording(control, out, "--frames", 8) as process:
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, without_progress(complaint, out)) == (0, [])
    assert said == f"{out}: 8 frames; as long as asked for\n" or "were lost" in said
    frames = played(out)
    assert [frame["source"] for frame in frames] == [f"take.oni#{n}" for n in range(8)]
    times = [datetime.fromisoformat(frame["captured_at"]) for frame in frames]
    assert times == sorted(set(times))
    assert before < times[0] < datetime.now(UTC)
    for frame in frames:
        # The stamps are the sensor's own: the skew is in the file.
        assert frame["skew_us"] == pytest.approx(-9_000, abs=1_000)
        assert frame["skew_known_by"] == "stamps"
        assert frame["sensor"]
        assert frame["rounding"] == "cut"
        assert frame["calibration"].startswith("recording: device: ZPD 120")


@pytest.mark.parametrize("name", ["take.oni", "take"])
def test_a_sensor_without_color_whose_unit_is_a_tenth_of_a_millimetre(control, tmp_path, name):
    control.color.present = False
    control.depth.offer(Mode(format=Format.DEPTH_100_UM))
    out = tmp_path / name
    with recording(control, out, "--frames", 4) as process:
        _, complaint = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, without_progress(complaint, out)) == (0, [])
    done = run_python(_MARKS, out, env=environment())
    frames = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(frames) == 4
    numbers = [frame["depth"] for frame in frames]
    assert numbers == sorted(set(numbers))
    for frame in frames:
        assert (frame["color"], frame["unit_um"], frame["skew_known_by"]) == (False, 100, "")
        assert frame["rounding"] == "cut"


def test_pairs_that_are_far_apart_stay_pairs(tmp_path):
    code = ("import sys\nfrom dataclasses import replace\nfrom pathlib import Path\n"
            "from denseface.capture import open_source\n"
            "from denseface.capture.oni.writer import OniWriter\n"
            "writer = OniWriter(Path(sys.argv[2]))\n"
            "shown = list(open_source(sys.argv[1], raw=True))\n"
            "for one in shown:\n"
            "    writer.add(replace(one, color_timestamp_us=one.depth_timestamp_us + 40_000))\n"
            "writer.close()\n"
            "played = list(open_source(sys.argv[2], raw=True))\n"
            "assert [a.skew_us for a in played] == [-40_000] * len(shown) != []\n"
            "for a, b in zip(shown, played):\n"
            "    assert (a.depth == b.depth).all()\n"
            "    assert abs(a.color.astype(int) - b.color).mean() < 3\n")
    done = run_python(code, RECORDINGS / "turned_18.oni", tmp_path / "b.oni", env=environment())
    assert (done.returncode, done.stderr) == (0, "")


def test_so_many_seconds_into_a_folder(control, tmp_path):
    out = tmp_path / "take"
    with recording(control, out, "--seconds", 0.5) as process:
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, without_progress(complaint, out)) == (0, [])
    assert "as long as asked for" in said
    frames = played(out)
    assert frames
    assert frames[0]["sensor"]
    assert frames[0]["captured_at"]
    assert frames[0]["source"] == f"openni2:{frames[0]['sensor']}"


@pytest.mark.parametrize(("name", "limit"), [("take.oni", 6_000_000), ("take", 1_000_000)])
def test_a_disk_on_which_writing_fails(control, tmp_path, name, limit):
    out = tmp_path / name
    with recording(control, out, limit, code=_LIMITED) as process:
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    if out.suffix:
        assert "File too large" in said
        # Whole but for its table of frames, for which there was no room either.
        assert len(played(out)) == pairs(out) >= 2
    else:
        # Not even the first frame's file: nothing is left.
        assert "File too large" in complaint
        assert not out.exists()


@pytest.mark.parametrize("looks", [0, 8])
def test_a_disk_that_is_nearly_full(control, tmp_path, looks):
    out = tmp_path / "take.oni"
    with recording(control, out, looks, code=_FILLING) as process:
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    words = f"{out}: the disk is nearly full: 200 MiB are free, 256 MiB are kept free"
    if looks:
        assert said == f"{out}: {looks - 1} frames; {words}\n" or "were lost" in said
        assert len(played(out)) == looks - 1
    else:
        assert complaint == f"denseface record: {words}\n"
        assert not out.exists()


def test_no_sensor(control, tmp_path):
    control.plugged = False
    out = tmp_path / "take.oni"
    with recording(control, out) as process:
        said, complaint = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    assert said == ""
    assert without_progress(complaint, out) == [
        "denseface record: openni2: OpenNI2 finds no sensor"]
    assert not out.exists()


def test_a_file_is_recorded_and_what_is_there_stays(tmp_path):
    """A recording to a folder and back gives the same frames."""
    source, folder, again = RECORDINGS / "turned_18.oni", tmp_path / "a", tmp_path / "b.oni"
    done = denseface("record", folder, "--source", source)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{folder}: 3 frames; the source is at its end\n"
    assert sorted(path.name for path in folder.iterdir()) == [f"00000{i}.npz" for i in range(3)]
    done = denseface("record", again, "--source", f"{folder}?frame=1")
    assert (done.returncode, done.stdout) == (0, f"{again}: 1 frames; the source is at its end\n")
    code = ("import sys, numpy as np\nfrom denseface.capture import open_source\n"
            "a, b = (list(open_source(name)) for name in sys.argv[1:])\n"
            "assert (a[1].depth == b[0].depth).all() and a[1].calibration == b[0].calibration\n"
            "assert a[1].depth_timestamp_us == b[0].depth_timestamp_us\n"
            "assert abs(a[1].color.astype(int) - b[0].color).mean() < 3\n"
            "assert a[1].depth_meaning == b[0].depth_meaning\nprint(b[0].calibration_origin)")
    done = run_python(code, folder, again, env=environment())
    assert (done.returncode, done.stdout) == (0, "recording: npz file\n"), done.stderr
    content = again.read_bytes()
    for out in (folder, again):
        done = denseface("record", out, "--source", source)
        assert done.returncode == 2
        assert done.stderr == (f"denseface record: {out}: there is a recording already; name "
                               "another, or remove it\n")
    assert again.read_bytes() == content


def test_what_it_cannot_be_recorded_to(tmp_path):
    done = denseface("record", tmp_path / "x.mp4", "--source", RECORDINGS / "turned_18.oni")
    assert done.returncode == 2
    assert done.stderr == (f"denseface record: {tmp_path}/x.mp4: expected NAME.oni or a folder\n")
    done = denseface("record", "/proc/no/x.oni", "--source", RECORDINGS / "x.oni")
    assert done.returncode == 1
    assert done.stderr == "denseface record: /proc/no/x.oni: No such file or directory\n"
    done = denseface("record", tmp_path / "x.oni", "--source", tmp_path / "none.oni")
    assert done.returncode == 2
    assert not (tmp_path / "x.oni").exists()
